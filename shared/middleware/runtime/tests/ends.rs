//! An instance that ends leaves nothing, whoever is about to join it.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used)]

use std::sync::atomic::{AtomicBool, Ordering};

use kerbside_messages::Process;
use kerbside_runtime::{Instance, Services, Session};

/// Lives of the instance: each end meets the joining threads at another point.
const LIVES: u32 = 12;

/// What is there of an instance: its segments, and whether its folder is.
fn left(instance: &Instance) -> (Vec<String>, bool) {
    let prefix = instance.prefix();
    let entries = std::fs::read_dir("/dev/shm").unwrap().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    (names.filter(|name| name.starts_with(&prefix)).collect(), instance.folder().exists())
}

/// One life of the instance, as its supervisor makes it.
fn live(instance: &Instance) -> Result<(), Box<dyn std::error::Error>> {
    let lock = instance.lock()?;
    drop(Services::create(instance)?);
    instance.remove()?;
    drop(lock);
    Ok(())
}

#[test]
fn who_joins_while_an_instance_ends_brings_nothing_back() {
    let base = tempfile::tempdir_in("/tmp").unwrap();
    let instance = Instance::below(base.path(), "ends").unwrap();
    for life in 0..LIVES {
        let ended = AtomicBool::new(false);
        let joined = std::thread::scope(|scope| {
            let join = || {
                let mut joined = 0;
                while !ended.load(Ordering::Relaxed) {
                    joined += u32::from(Session::join(&instance, Process::Operator).is_ok());
                }
                joined
            };
            let threads = [scope.spawn(join), scope.spawn(join)];
            let lived = live(&instance);
            ended.store(true, Ordering::Relaxed);
            lived.unwrap();
            threads.map(|thread| thread.join().unwrap()).iter().sum::<u32>()
        });
        println!("life {life}: joined {joined} times");
        assert_eq!(left(&instance), (Vec::new(), false), "after life {life}");
    }
}
