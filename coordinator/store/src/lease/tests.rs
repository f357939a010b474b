use super::*;
use crate::{DataDirectory, Store, files};
use std::{
    process::Command,
    sync::{Barrier, atomic::AtomicBool},
};

fn shared() -> FileSystem {
    FileSystem::of_kind("nfs4".to_owned())
}

/// Takes the lease as the only process that has the lock of a local file system.
fn take(data: &Path) -> Result<(Lease, bool), Refusal> {
    take_by(data, &FileSystem::of_kind("ext4".to_owned()), true)
}

/// Takes the lease through a network. Also returns whether the files were replaced.
fn take_elsewhere(data: &Path) -> Result<(Lease, bool), Refusal> {
    take_by(data, &shared(), false)
}

/// Also returns whether the files must be replaced.
fn take_by(data: &Path, file_system: &FileSystem, locked: bool) -> Result<(Lease, bool), Refusal> {
    let interrupt = Interrupt::default();
    let lease = Lease::take(data, file_system, locked, Unknown::TakeOver(&interrupt))?;
    let renews = lease.holder.renews;
    Ok((lease, renews))
}

/// A lease of this process that has no file yet.
fn untaken(data: &Path, number: u64) -> Lease {
    Lease {
        data: data.to_path_buf(),
        number,
        holder: Holder::current(&shared()),
        beaten: AtomicI64::new(0),
        lost: watch::Sender::new(false),
    }
}

/// The lease `number` of a process on another machine, which reaches the folder over a network.
fn elsewhere(data: &Path, number: u64, change: impl FnOnce(&mut Holder)) {
    let folder = data.join(FOLDER);
    make_folder(&folder).unwrap();
    let mut holder = Holder {
        machine: "node-7".to_owned(),
        boot: "another".to_owned(),
        ..Holder::current(&shared())
    };
    change(&mut holder);
    fs::write(file_of(&folder, number), serde_json::to_vec(&holder).unwrap()).unwrap();
    fs::write(beat_of(&folder, number), "7").unwrap();
}

#[test]
fn of_many_processes_one_gets_the_lease() {
    for _ in 0..20 {
        let folder = tempfile::tempdir().unwrap();
        take_elsewhere(folder.path()).unwrap().0.end();
        let start = Barrier::new(8);
        let taken: Vec<_> = thread::scope(|scope| {
            let takers: Vec<_> = (0..8)
                .map(|_| {
                    scope.spawn(|| {
                        start.wait();
                        take_elsewhere(folder.path())
                    })
                })
                .collect();
            takers.into_iter().map(|taker| taker.join().unwrap()).collect()
        });
        let mut winners = Vec::new();
        for one in taken {
            match one {
                Ok((lease, _)) => winners.push(lease),
                Err(Refusal::Held) => {}
                Err(failed) => panic!("{failed:?}"),
            }
        }
        assert_eq!(winners.len(), 1);
        winners[0].check().unwrap();
    }
}

#[test]
fn a_process_that_runs_keeps_its_lease_and_one_that_was_killed_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let own = take(folder.path()).unwrap().0;
    // This process runs, whatever the lock says.
    assert!(matches!(take(folder.path()), Err(Refusal::Held)));
    own.check().unwrap();
    own.end();
    let mut child = Command::new("sleep").arg("100").spawn().unwrap();
    let process = Pid::from_child(&child);
    elsewhere(folder.path(), 2, |holder| {
        holder.boot = Holder::current(&shared()).boot;
        holder.process = process.as_raw_pid();
        holder.began = Life::of(process).map(|life| life.began);
    });
    let refused = take_elsewhere(folder.path());
    assert!(matches!(refused, Err(Refusal::Held)), "{refused:?}");
    child.kill().unwrap();
    // The killed process is not waited for, so the system still lists it.
    while Life::of(process).is_some_and(|life| life.runs) {
        thread::sleep(LOOK_PAUSE);
    }
    let begun = Instant::now();
    let (lease, may_run) = take_elsewhere(folder.path()).unwrap();
    assert!(!may_run && begun.elapsed() < SILENCE && lease.number == 3);
    child.wait().unwrap();
    // Its number can belong to another process now.
    lease.end();
    elsewhere(folder.path(), 4, |holder| {
        holder.boot = Holder::current(&shared()).boot;
        holder.began = Some(1);
    });
    assert!(!take_elsewhere(folder.path()).unwrap().1);
}

#[test]
fn a_process_elsewhere_keeps_its_lease_while_its_counter_changes() {
    let folder = tempfile::tempdir().unwrap();
    elsewhere(folder.path(), 5, |_| {});
    let beat = beat_of(&folder.path().join(FOLDER), 5);
    let ended = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| {
            for count in 8.. {
                if ended.load(Ordering::Relaxed) {
                    break;
                }
                thread::sleep(BEAT);
                fs::write(&beat, count.to_string()).unwrap();
            }
        });
        let refused = take(folder.path());
        assert!(matches!(refused, Err(Refusal::Held)), "{refused:?}");
        assert!(is_held(folder.path(), &shared(), false).unwrap());
        ended.store(true, Ordering::Relaxed);
    });
    let begun = Instant::now();
    let (lease, may_run) = take(folder.path()).unwrap();
    assert!(may_run && begun.elapsed() >= SILENCE && lease.number == 6);
}

#[test]
fn the_lock_of_a_local_file_system_suffices() {
    let folder = tempfile::tempdir().unwrap();
    // The last process of a container, whose successor has another name and another table of processes.
    elsewhere(folder.path(), 1, |holder| holder.is_local = true);
    let begun = Instant::now();
    let (lease, may_run) = take(folder.path()).unwrap();
    assert!(!may_run && begun.elapsed() < SILENCE && lease.number == 2);
}

#[test]
fn a_takeover_that_was_not_finished_is_finished_by_the_next_process() {
    let folder = tempfile::tempdir().unwrap();
    elsewhere(folder.path(), 1, |_| {});
    let (lease, renews) = take_elsewhere(folder.path()).unwrap();
    let failed = lease.renew(|_, _| Err(StoreError::DiskFull { path: "".into() }));
    assert!(
        renews && matches!(failed, Err(StoreError::DiskFull { .. })),
        "{failed:?}"
    );
    // The process has ended since, and its successor knows that.
    let leases = folder.path().join(FOLDER);
    let text = fs::read_to_string(file_of(&leases, 2)).unwrap();
    let mut holder: Holder = serde_json::from_str(&text).unwrap();
    assert!(holder.renews);
    holder.began = Some(1);
    fs::write(file_of(&leases, 2), serde_json::to_vec(&holder).unwrap()).unwrap();
    let (lease, renews) = take(folder.path()).unwrap();
    assert!(renews && lease.number == 3);
    lease.renew(|_, check| check()).unwrap();
    lease.end();
    assert!(!take(folder.path()).unwrap().1);
}

#[test]
fn a_lease_that_a_dead_process_did_not_remove_still_counts() {
    let folder = tempfile::tempdir().unwrap();
    elsewhere(folder.path(), 4, |holder| holder.is_local = true);
    let own = Holder::current(&shared());
    elsewhere(folder.path(), 5, |holder| {
        *holder = Holder {
            began: Some(1),
            renews: true,
            ..own.clone()
        }
    });
    elsewhere(folder.path(), 3, |holder| *holder = own.clone());
    let refused = take(folder.path());
    assert!(matches!(refused, Err(Refusal::Held)), "{refused:?}");
    fs::write(file_of(&folder.path().join(FOLDER), 3), "").unwrap();
    assert!(take(folder.path()).unwrap().1);
}

#[test]
fn a_holder_elsewhere_is_spared_at_once_and_the_wait_for_it_ends_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    elsewhere(folder.path(), 1, |_| {});
    let begun = Instant::now();
    let interrupt = Interrupt::default();
    interrupt.raise();
    for (unknown, expected) in [
        (Unknown::Spare, "Held"),
        (Unknown::TakeOver(&interrupt), "Interrupted"),
    ] {
        let refused = Lease::take(folder.path(), &shared(), false, unknown);
        let refused = format!("{refused:?}");
        assert!(refused.contains(expected), "{refused}");
    }
    assert!(begun.elapsed() < SILENCE);
}

#[test]
fn files_that_are_not_leases_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let leases = folder.path().join(FOLDER);
    fs::write(&leases, "a contract").unwrap();
    let expect = |named: &str| match take(folder.path()) {
        Err(Refusal::Failed { path, source, .. }) => {
            assert!(
                path.starts_with(&leases) && source.to_string().contains(named),
                "{source}"
            );
        }
        taken => panic!("{taken:?}"),
    };
    expect("not a folder");
    fs::remove_file(&leases).unwrap();
    fs::create_dir(&leases).unwrap();
    fs::write(leases.join("notes.json"), "{}").unwrap();
    fs::write(leases.join("3.json"), "{}").unwrap();
    expect("not Murmuration's");
    fs::remove_file(leases.join("3.json")).unwrap();
    elsewhere(folder.path(), u64::MAX, |holder| holder.ended = true);
    expect("used up");
    fs::remove_file(file_of(&leases, u64::MAX)).unwrap();
    assert_eq!(take(folder.path()).unwrap().0.number, 1);
    assert_eq!(fs::read_to_string(leases.join("notes.json")).unwrap(), "{}");
}

/// A process that could not take the lease removes its file, and another one can take the lease with the same number.
#[test]
fn only_examined_leases_are_fenced_off() {
    let folder = tempfile::tempdir().unwrap();
    let leases = folder.path().join(FOLDER);
    elsewhere(folder.path(), 5, |holder| holder.id = "first".to_owned());
    let examined = Examined::of(&leases, &[5]).unwrap();
    fs::remove_file(file_of(&leases, 5)).unwrap();
    elsewhere(folder.path(), 5, |holder| holder.id = "second".to_owned());
    let late = untaken(folder.path(), 6);
    assert!(matches!(late.make(&leases, &examined), Err(Refusal::Held)));
    assert_eq!(numbers(&leases).unwrap(), [5]);
}

/// Only the lease of the process that failed tells the next one that the former holder may still write.
#[test]
fn a_lease_stays_if_the_former_one_cannot_be_removed() {
    let folder = tempfile::tempdir().unwrap();
    let leases = folder.path().join(FOLDER);
    elsewhere(folder.path(), 5, |_| {});
    let failing = untaken(folder.path(), 6);
    failing.write(&failing.holder).unwrap();
    // A folder cannot be removed as a file.
    fs::remove_file(file_of(&leases, 5)).unwrap();
    fs::create_dir(file_of(&leases, 5)).unwrap();
    assert!(matches!(
        failing.fence_off(&leases, vec![5]),
        Err(Refusal::Failed { doing: "remove", .. })
    ));
    failing.check().unwrap();
}

#[test]
fn a_store_that_is_closed_refuses_changes_and_has_no_log() {
    let folder = tempfile::tempdir().unwrap();
    let held = DataDirectory::hold(folder.path()).unwrap();
    let store = Store::open(&held).unwrap();
    let change = |store: &Store| {
        store.write(|transaction| {
            Ok(transaction.execute_batch("CREATE TABLE IF NOT EXISTS notes (note TEXT)")?)
        })
    };
    change(&store).unwrap();
    let log = files::log_of(&folder.path().join(Store::FILE));
    assert!(log.metadata().unwrap().len() > 0);
    store.close();
    drop(held);
    assert!(matches!(change(&store), Err(StoreError::Interrupted(_))));
    assert_eq!(log.metadata().unwrap().len(), 0);
}

#[test]
fn a_store_whose_database_was_removed_or_replaced_changes_nothing() {
    for replaces in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let held = DataDirectory::hold(folder.path()).unwrap();
        let store = Store::open(&held).unwrap();
        store.write(|_| Ok(())).unwrap();
        let database = folder.path().join(Store::FILE);
        let copy = folder.path().join("copy");
        fs::copy(&database, &copy).unwrap();
        fs::remove_file(&database).unwrap();
        if replaces {
            fs::rename(&copy, &database).unwrap();
        }
        let refused = store.write(|_| Ok(())).unwrap_err();
        assert!(matches!(refused, StoreError::Replaced(_)), "{refused}");
    }
}

#[test]
fn a_process_that_was_taken_over_changes_nothing_more() {
    let folder = tempfile::tempdir().unwrap();
    let held = DataDirectory::hold(folder.path()).unwrap();
    let store = Store::open(&held).unwrap();
    store.write(|_| Ok(())).unwrap();
    let other = untaken(folder.path(), held.lease().number + 1);
    // The counter of this process was not heard elsewhere.
    let leases = folder.path().join(FOLDER);
    let examined = Examined::of(&leases, &numbers(&leases).unwrap()).unwrap();
    other.make(&leases, &examined).unwrap();
    let mut is_run = false;
    let change = store.write(|_| {
        is_run = true;
        Ok(())
    });
    let refused = change.unwrap_err();
    assert!(
        matches!(refused, StoreError::TakenOver(_)) && !is_run,
        "{refused}"
    );
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let told = runtime.block_on(held.taken_over());
    assert!(matches!(told, StoreError::TakenOver(_)), "{told}");
    drop((store, held));
    // The end of the former holder leaves the lease of the other as it is.
    other.check().unwrap();
}

#[test]
fn a_change_during_which_another_process_took_over_is_not_acknowledged() {
    let folder = tempfile::tempdir().unwrap();
    let held = DataDirectory::hold(folder.path()).unwrap();
    let store = Store::open(&held).unwrap();
    let own = file_of(&folder.path().join(FOLDER), held.lease().number);
    let change = store.write(|_| {
        fs::remove_file(&own).unwrap();
        Ok(())
    });
    assert!(matches!(change, Err(StoreError::TakenOver(_))));
}

#[test]
fn a_process_that_takes_over_works_on_files_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let open = |data: &Path| Store::open(&DataDirectory::hold(data).unwrap()).unwrap();
    drop(open(folder.path()));
    let database = folder.path().join(Store::FILE);
    let former = fs::File::options().write(true).open(&database).unwrap();
    let ended = numbers(&folder.path().join(FOLDER)).unwrap();
    elsewhere(folder.path(), newest_of(&ended).unwrap() + 1, |_| {});
    let store = open(folder.path());
    // The former holder goes on with what it had begun.
    former.set_len(10).unwrap();
    assert!(store.faults().unwrap().is_empty());
}

#[test]
fn a_process_that_is_taken_over_while_it_copies_replaces_nothing() {
    let folder = tempfile::tempdir().unwrap();
    drop(Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap());
    let leases = folder.path().join(FOLDER);
    let last = newest_of(&numbers(&leases).unwrap()).unwrap();
    elsewhere(folder.path(), last + 1, |_| {});
    let (slow, renews) = take_elsewhere(folder.path()).unwrap();
    assert!(renews);
    let database = folder.path().join(Store::FILE);
    let before = fs::metadata(&database).unwrap().modified().unwrap();
    let checks = AtomicI64::new(0);
    let renewed = slow.renew(|new, check| {
        let check = || {
            // Another process takes over during the copy.
            if checks.fetch_add(1, Ordering::Relaxed) == 1 {
                fs::remove_file(slow.path()).unwrap();
            }
            check()
        };
        crate::open::renew(folder.path(), new, &check)
    });
    assert!(checks.into_inner() > 1);
    assert!(matches!(renewed, Err(StoreError::TakenOver(_))), "{renewed:?}");
    assert_eq!(fs::metadata(&database).unwrap().modified().unwrap(), before);
    assert!(!slow.path().exists());
    let left = fs::read_dir(folder.path()).unwrap().flatten();
    let left = left.filter(|entry| entry.file_name().to_string_lossy().contains("renewed"));
    assert_eq!(left.count(), 0);
}

#[test]
fn files_of_leases_are_not_written_through_links() {
    let folder = tempfile::tempdir().unwrap();
    let victim = folder.path().join("notes.txt");
    fs::write(&victim, "notes").unwrap();
    let leases = folder.path().join(FOLDER);
    fs::create_dir(&leases).unwrap();
    for name in ["1.beat", "1.new"] {
        std::os::unix::fs::symlink(&victim, leases.join(name)).unwrap();
    }
    assert!(matches!(take(folder.path()), Err(Refusal::Failed { .. })));
    assert_eq!(fs::read_to_string(&victim).unwrap(), "notes");
}
