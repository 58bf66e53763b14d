//! Who was built from other layouts is refused, with both versions named: by the name of the type when it joins, and by
//! the header where only the header tells.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::panic)]

use iceoryx2::prelude::*;
use kerbside_messages::{
    LAYOUT_VERSION, Message, OperatorAnswer, OperatorRequest, Permit, Plan, Process, Raw,
    check_sum, seal,
};
use kerbside_runtime::{Instance, Services, Session};

/// Payloads of an older build: other names, other sizes.
#[repr(C)]
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("kerbside.Raw.v2")]
struct OldRaw {
    content: [u64; 20],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, ZeroCopySend)]
#[type_name("kerbside.Plan.v2")]
struct OldPlan {
    content: [u64; 10],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("kerbside.OperatorRequest.v2")]
struct OldRequest {
    content: [u64; 8],
}

/// A node in the instance as its supervisor has it, or any other process.
fn node(instance: &Instance) -> Node<ipc::Service> {
    let text = std::fs::read_to_string(instance.configuration()).unwrap();
    let prefix = text.lines().find_map(|line| line.strip_prefix("prefix = ")).unwrap();
    let mut config = Config::default();
    let root = instance.root();
    config.global.set_root_path(&Path::new(root.as_os_str().as_encoded_bytes()).unwrap());
    config.global.prefix = FileName::new(prefix.trim_matches('"').as_bytes()).unwrap();
    let builder = NodeBuilder::new().config(&config);
    builder.signal_handling_mode(SignalHandlingMode::Disabled).create().unwrap()
}

fn service(name: &str) -> ServiceName {
    ServiceName::new(name).unwrap()
}

/// One test function: the middleware's configuration is per process, so an instance is too.
#[test]
fn who_has_other_layouts_is_refused_with_both_versions_named() {
    let base = tempfile::tempdir_in("/tmp").unwrap();
    let instance = Instance::below(base.path(), "versions").unwrap();
    let lock = instance.lock().unwrap();
    this_build_in_an_older_stack(&instance);
    instance.wipe().unwrap();
    an_older_peer_in_this_builds_stack(&instance);
    drop(lock);
    instance.remove().unwrap();
}

fn this_build_in_an_older_stack(instance: &Instance) {
    instance.write_configuration().unwrap();
    let node = node(instance);
    let raw = node.service_builder(&service("raw")).publish_subscribe::<OldRaw>().create().unwrap();
    let plan = node
        .service_builder(&service("plan"))
        .publish_subscribe::<[u64]>()
        .user_header::<OldPlan>()
        .create()
        .unwrap();
    let door = node
        .service_builder(&service("operator"))
        .request_response::<OldRequest, OldRaw>()
        .create()
        .unwrap();
    let session = Session::join(instance, Process::Operator).unwrap();
    let refused = [
        session.subscriber::<Raw>(None, 1).unwrap_err(),
        session.publisher::<Raw>(None).unwrap_err(),
        session.plan_subscriber().unwrap_err(),
        session.client::<OperatorRequest, OperatorAnswer>().unwrap_err(),
    ];
    let old = ["Raw.v2 of 160", "Raw.v2 of 160", "Plan.v2 of 80", "OperatorRequest.v2 of 64"];
    let new = [Raw::TYPE_NAME, Raw::TYPE_NAME, Plan::TYPE_NAME, OperatorRequest::TYPE_NAME];
    for ((error, old), new) in refused.into_iter().zip(old).zip(new) {
        assert!(!error.is_missing(), "nobody waits for another build to go away: {error}");
        let said = error.to_string();
        assert!(said.contains(&format!("the running stack has kerbside.{old} bytes")), "{said}");
        assert!(said.contains(&format!("this build has {new} of ")), "{said}");
    }
    drop((session, raw, plan, door));
}

fn an_older_peer_in_this_builds_stack(instance: &Instance) {
    let services = Services::create(instance).unwrap();
    let peer = node(instance);
    let joined = peer.service_builder(&service("raw")).publish_subscribe::<OldRaw>().open();
    assert!(format!("{:?}", joined.unwrap_err()).contains("IncompatibleTypes"));

    // A peer whose type has the right name, and whose samples are of another version.
    let session = Session::join(instance, Process::Operator).unwrap();
    let mut publisher = session.publisher::<Permit>(None).unwrap();
    let mut subscriber = session.subscriber::<Permit>(None, 8).unwrap();
    let mut permit = Permit::default();
    seal(&mut permit, &[], 1, 1, 1);
    permit.header.version = LAYOUT_VERSION - 1;
    permit.header.check_sum = check_sum(&permit, &[]);
    publisher.send_sealed(&permit).unwrap();
    assert!(subscriber.receive().is_none());
    let said = subscriber.refusals().newest.unwrap().to_string();
    let (theirs, ours) = (LAYOUT_VERSION - 1, LAYOUT_VERSION);
    assert_eq!(said, format!("layout version {theirs}, ours is {ours}"));
    drop((publisher, subscriber, session, peer));
    drop(services);
}
