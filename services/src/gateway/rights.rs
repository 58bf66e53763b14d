//! Who may do what: names of the configuration against what the kernel says of a peer.

use kerbside_runtime::Peer;
use kerbside_settings::{GatewaySettings, Right};
use nix::unistd::{Group, User};

use crate::exit::{Exit, Failure};

/// The rights of users and groups.
#[derive(Clone, Debug)]
pub struct Rights {
    /// The instance's own user, who may do everything: shared memory is theirs.
    owner: u32,
    /// In the order of [`Right::ALL`].
    holders: [Holders; Right::ALL.len()],
}

#[derive(Clone, Debug, Default)]
struct Holders {
    everybody: bool,
    users: Vec<u32>,
    groups: Vec<u32>,
}

/// The rights of one peer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Granted([bool; Right::ALL.len()]);

impl Granted {
    /// Whether it has this right.
    #[must_use]
    pub fn has(self, right: Right) -> bool {
        self.0[right as usize]
    }

    /// The names of its rights.
    #[must_use]
    pub fn names(self) -> Vec<&'static str> {
        Right::ALL.into_iter().filter(|right| self.has(*right)).map(Right::name).collect()
    }
}

impl Rights {
    /// Looks up the users and groups that `settings` name, for an instance of user `owner`.
    ///
    /// # Errors
    /// [`Failure`] naming the key, and the user or group that this machine does not know.
    pub fn of(settings: &GatewaySettings, owner: u32) -> Result<Self, Failure> {
        let mut holders: [Holders; Right::ALL.len()] = Default::default();
        for right in Right::ALL {
            for name in settings.holders(right) {
                holders[right as usize].add(name).map_err(|found| refused(right, name, found))?;
            }
        }
        Ok(Self { owner, holders })
    }

    /// What `peer` may do.
    #[must_use]
    pub fn granted(&self, peer: &Peer) -> Granted {
        if peer.user == self.owner || peer.user == 0 {
            return Granted([true; Right::ALL.len()]);
        }
        let has = |holders: &Holders| {
            holders.everybody
                || holders.users.contains(&peer.user)
                || peer.groups.iter().any(|group| holders.groups.contains(group))
        };
        Granted(core::array::from_fn(|right| has(&self.holders[right])))
    }
}

impl Holders {
    fn add(&mut self, name: &str) -> Result<(), &'static str> {
        if name == "*" {
            self.everybody = true;
            return Ok(());
        }
        match name.strip_prefix('@') {
            Some(group) => self.groups.push(group_named(group).ok_or("no group of that name")?),
            None => self.users.push(user_named(name).ok_or("no user of that name")?),
        }
        Ok(())
    }
}

/// A number is the user of that number, known to the machine or not.
fn user_named(name: &str) -> Option<u32> {
    name.parse().ok().or_else(|| Some(User::from_name(name).ok()??.uid.as_raw()))
}

fn group_named(name: &str) -> Option<u32> {
    name.parse().ok().or_else(|| Some(Group::from_name(name).ok()??.gid.as_raw()))
}

fn refused(right: Right, name: &str, found: &str) -> Failure {
    Failure::with_help(
        Exit::Configuration,
        format!("gateway.rights.{}: \"{}\": {found}", right.name(), crate::fields::cut(name)),
        "allowed are users of this machine by name or number, groups as \"@name\" or \"@number\", and \"*\" for everybody",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rights(text: &str) -> Result<Rights, Failure> {
        let folder = tempfile::tempdir().unwrap();
        let stack = folder.path().join("stack.toml");
        let text = format!(
            "vehicle = \"paper-1-6\"\n[safety]\nstop_distance = 0.65\n[gateway.rights]\n{text}\n"
        );
        std::fs::write(&stack, text).unwrap();
        let stack = crate::configuration::stack(Some(stack.as_path()), None).unwrap();
        Rights::of(&stack.gateway, 500)
    }

    fn peer(user: u32, groups: &[u32]) -> Peer {
        Peer { pid: 1, user, groups: groups.to_vec() }
    }

    #[test]
    fn users_groups_and_everybody() {
        let rights =
            rights("watch = [\"*\"]\nfix = [\"21001\"]\nstop = [\"@77\", \"21002\"]").unwrap();
        let names = |user, groups: &[u32]| rights.granted(&peer(user, groups)).names();
        assert_eq!(names(21_000, &[21_000]), ["watch"]);
        assert_eq!(names(21_001, &[1]), ["watch", "fix"]);
        assert_eq!(names(21_002, &[77]), ["watch", "stop"]);
        assert_eq!(names(9, &[1, 2, 77]), ["watch", "stop"]);
        // A user's number is no group's.
        assert_eq!(names(77, &[21_001]), ["watch"]);
        assert_eq!(names(500, &[]).len(), Right::ALL.len());
        assert_eq!(names(0, &[]).len(), Right::ALL.len());
    }

    #[test]
    fn names_are_looked_up_and_unknown_ones_refused() {
        let known = rights("arm = [\"root\", \"@root\"]").unwrap();
        assert_eq!(known.granted(&peer(9, &[0])).names(), ["arm"]);
        for (text, words) in [
            ("arm = [\"nobody-of-that-name\"]", "gateway.rights.arm: \"nobody-of-that-name\""),
            ("stop = [\"@no-such-group\"]", "no group of that name"),
        ] {
            let failure = rights(text).unwrap_err();
            assert_eq!(failure.exit, Exit::Configuration);
            assert!(failure.report.to_string().contains(words), "{:?}", failure.report);
        }
    }

    #[test]
    fn nobody_has_a_right_that_is_not_given() {
        assert_eq!(rights("").unwrap().granted(&peer(9, &[9])).names(), Vec::<&str>::new());
    }
}
