//! What a user may cost: connections at once, and requests a second.

use std::collections::BTreeMap;

use kerbside_messages::{Nanos, nanos, seconds};
use kerbside_settings::GatewaySettings;

/// The accounts of all users that have, or lately had, a client.
#[derive(Clone, Debug)]
pub struct Accounts {
    clients: u32,
    clients_per_user: u32,
    rate: f64,
    open: u32,
    by_user: BTreeMap<u32, Account>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Account {
    clients: u32,
    budget: Budget,
}

/// Tokens that come in at a steady rate, up to what comes in a second; each request takes one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Budget {
    tokens: f64,
    at: Nanos,
}

impl Budget {
    fn fill(&mut self, rate: f64, now: Nanos) {
        let new = rate * seconds(now.saturating_sub(self.at));
        self.tokens = (self.tokens + new).min(rate.max(1.0));
        self.at = self.at.max(now);
    }
}

/// Why a client is not let in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Crowded {
    /// The gateway is full.
    #[error("found {found} clients, allowed are gateway.clients = {found}")]
    All {
        /// As many as there may be.
        found: u32,
    },
    /// The user has as many clients as it may.
    #[error("found {found} clients of user {user}, allowed are gateway.clients_per_user = {found}")]
    OfUser {
        /// The user.
        user: u32,
        /// As many as there may be.
        found: u32,
    },
    /// The user asks too often.
    #[error("user {user} asks more often than gateway.request_rate = {rate} a second allows")]
    Hasty {
        /// The user.
        user: u32,
        /// Requests a second, rounded.
        rate: u32,
    },
}

impl Accounts {
    /// Nobody yet.
    #[must_use]
    pub fn new(settings: &GatewaySettings) -> Self {
        Self {
            clients: settings.clients,
            clients_per_user: settings.clients_per_user,
            rate: settings.request_rate,
            open: 0,
            by_user: BTreeMap::new(),
        }
    }

    /// A client of `user` comes; connecting counts as a request.
    ///
    /// # Errors
    /// [`Crowded`] where it may not.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // for a message; rates are small and positive
    pub fn enter(&mut self, user: u32, now: Nanos) -> Result<(), Crowded> {
        self.forget(now);
        if self.ready_at(user, now) > now {
            return Err(Crowded::Hasty { user, rate: self.rate.ceil() as u32 });
        }
        self.take(user, now);
        if self.open >= self.clients {
            return Err(Crowded::All { found: self.open });
        }
        let most = self.clients_per_user;
        let account = self.account(user, now);
        if account.clients >= most {
            return Err(Crowded::OfUser { user, found: account.clients });
        }
        account.clients += 1;
        self.open += 1;
        Ok(())
    }

    /// A client of `user` goes.
    pub fn leave(&mut self, user: u32) {
        if let Some(account) = self.by_user.get_mut(&user) {
            account.clients = account.clients.saturating_sub(1);
            self.open = self.open.saturating_sub(1);
        }
    }

    /// When `user` may make its next request; `now` or earlier means at once.
    pub fn ready_at(&mut self, user: u32, now: Nanos) -> Nanos {
        let rate = self.rate;
        let account = self.account(user, now);
        account.budget.fill(rate, now);
        let lacking = 1.0 - account.budget.tokens;
        if lacking <= 0.0 { now } else { now + nanos(lacking / rate).max(1) }
    }

    /// `user` makes a request.
    pub fn take(&mut self, user: u32, now: Nanos) {
        let rate = self.rate;
        let budget = &mut self.account(user, now).budget;
        budget.fill(rate, now);
        budget.tokens = (budget.tokens - 1.0).max(0.0);
    }

    fn account(&mut self, user: u32, now: Nanos) -> &mut Account {
        let fresh = Account { clients: 0, budget: Budget { tokens: self.rate.max(1.0), at: now } };
        self.by_user.entry(user).or_insert(fresh)
    }

    /// Accounts that are as good as new need not be kept.
    fn forget(&mut self, now: Nanos) {
        let rate = self.rate;
        self.by_user.retain(|_, account| {
            account.budget.fill(rate, now);
            account.clients > 0 || account.budget.tokens < rate.max(1.0)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Nanos = 1_000_000_000;

    fn accounts(clients: u32, clients_per_user: u32, request_rate: f64) -> Accounts {
        let mut settings = GatewaySettings::default();
        (settings.clients, settings.clients_per_user) = (clients, clients_per_user);
        settings.request_rate = request_rate;
        Accounts::new(&settings)
    }

    #[test]
    fn the_room_is_shared_out_by_user() {
        let mut accounts = accounts(3, 2, 100.0);
        assert_eq!(accounts.enter(1, 0), Ok(()));
        assert_eq!(accounts.enter(1, 0), Ok(()));
        assert_eq!(accounts.enter(1, 0), Err(Crowded::OfUser { user: 1, found: 2 }));
        assert_eq!(accounts.enter(2, 0), Ok(()));
        assert_eq!(accounts.enter(3, 0), Err(Crowded::All { found: 3 }));
        accounts.leave(1);
        assert_eq!(accounts.enter(3, 0), Ok(()));
        // Who was never let in cannot make room by going.
        accounts.leave(9);
        assert_eq!(accounts.enter(4, 0), Err(Crowded::All { found: 3 }));
    }

    #[test]
    fn requests_are_bounded_over_any_time() {
        let mut accounts = accounts(4, 4, 10.0);
        let (mut now, mut taken) = (0, 0_u64);
        while now < 10 * SECOND {
            let ready = accounts.ready_at(7, now);
            if ready <= now {
                accounts.take(7, now);
                taken += 1;
            }
            now = ready.max(now + 1_000);
        }
        assert!((105..=110).contains(&taken), "{taken}");
    }

    #[test]
    fn one_users_haste_is_nobody_elses() {
        let mut accounts = accounts(100, 100, 5.0);
        let hasty = (0..50).filter(|_| accounts.enter(1, SECOND).is_ok()).count();
        assert_eq!(hasty, 5);
        assert!(matches!(accounts.enter(1, SECOND), Err(Crowded::Hasty { user: 1, rate: 5 })));
        assert_eq!(accounts.enter(2, SECOND), Ok(()));
        assert_eq!(accounts.enter(1, 2 * SECOND), Ok(()));
    }

    #[test]
    fn accounts_of_passers_by_are_forgotten() {
        let mut accounts = accounts(4, 4, 10.0);
        for user in 0..1000 {
            let _ = accounts.enter(user, u64::from(user) * SECOND);
            accounts.leave(user);
        }
        assert!(accounts.by_user.len() <= 2, "{}", accounts.by_user.len());
    }
}
