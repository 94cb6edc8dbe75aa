use std::time::SystemTime;

use super::*;

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn the_old_file_is_there_until_the_new_one_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    write(&path, "old").unwrap();
    let mut file = AtomicFile::create(&path).unwrap();
    file.write_all(b"a new one").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(folder.path()).len(), 2);
    file.finish().unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"a new one");
    assert_eq!(names(folder.path()), ["a.txt"]);
}

#[test]
fn what_is_given_up_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    let begun = || {
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        file
    };
    drop(begun());
    assert_eq!(names(folder.path()), [""; 0]);
    let error = begun().failed(ErrorKind::StorageFull.into());
    assert_eq!(error.notes(), [format!("{} was not created", path.display())]);
    write_unsynced(&path, "old").unwrap();
    let error = begun().failed(ErrorKind::StorageFull.into());
    assert!(error.message().starts_with(&path.display().to_string()), "{error}");
    assert_eq!(error.notes(), [format!("{} is unchanged", path.display())]);
    let panicked = std::thread::spawn({
        let path = path.clone();
        move || {
            let _file = AtomicFile::create(&path).unwrap();
            std::panic::resume_unwind(Box::new(()));
        }
    });
    assert!(panicked.join().is_err());
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["a.txt"]);
}

#[test]
fn a_path_that_cannot_be_written_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    for path in [folder.path().to_path_buf(), folder.path().join("no/such/a.txt")] {
        let error = write(&path, "new").unwrap_err();
        assert_eq!(error.kind(), crate::error::ErrorKind::Io);
        assert!(error.message().starts_with(&path.display().to_string()), "{error}");
        assert!(!error.message().contains("anyhit-tmp"), "{error}");
    }
    assert_eq!(names(folder.path()), [""; 0]);
    // The longest name that a file may have: what stands beside it has a shorter one.
    let long = folder.path().join("n".repeat(255));
    write(&long, "new").unwrap();
    assert_eq!(fs::read(&long).unwrap(), b"new");
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_permissions_stay() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("real")).unwrap();
    fs::write(at("real/a.txt"), "old").unwrap();
    fs::set_permissions(at("real/a.txt"), fs::Permissions::from_mode(0o640)).unwrap();
    symlink("real", at("folder")).unwrap();
    symlink("folder/a.txt", at("first")).unwrap();
    symlink(at("first"), at("second")).unwrap();
    let before = fs::metadata(at("real/a.txt")).unwrap();
    write(&at("second"), "new").unwrap();
    assert_eq!(fs::read(at("real/a.txt")).unwrap(), b"new");
    let after = fs::metadata(at("real/a.txt")).unwrap();
    assert_eq!(after.mode(), before.mode());
    assert_ne!(after.ino(), before.ino(), "it was overwritten, not replaced");
    assert_eq!(names(folder.path()), ["first", "folder", "real", "second"]);
    assert_eq!(names(&at("real")), ["a.txt"]);
    // A link to what is not there yet, and links in a circle.
    symlink("real/new", at("dangling")).unwrap();
    write(&at("dangling"), "made").unwrap();
    assert_eq!(fs::read(at("real/new")).unwrap(), b"made");
    symlink("circle", at("circle")).unwrap();
    assert!(write(&at("circle"), "never").is_err());
}

#[cfg(unix)]
#[test]
fn what_may_not_be_written_is_not_replaced_and_what_may_be_is() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    let allow = |path: &Path, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    fs::write(&path, "old").unwrap();
    allow(&path, 0o444);
    // A superuser may do both.
    let is_super = File::options().write(true).open(&path).is_ok();
    let written = write(&path, "new");
    assert_eq!(written.is_ok(), is_super);
    assert_eq!(fs::read_to_string(&path).unwrap(), if is_super { "new" } else { "old" });
    allow(&path, 0o644);
    allow(folder.path(), 0o555);
    let before = fs::metadata(&path).unwrap();
    write(&path, "newer").unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "newer");
    assert_eq!(fs::metadata(&path).unwrap().ino() == before.ino(), !is_super, "in place");
    allow(folder.path(), 0o755);
    assert_eq!(names(folder.path()), ["a.txt"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_in_a_folder_that_takes_no_new_ones_is_written_in_place() {
    // Nobody makes a file there, and everybody may write the name of his own thread.
    let path = Path::new("/proc/thread-self/comm");
    if !path.exists() {
        return;
    }
    write(path, "in-place").unwrap();
    assert_eq!(fs::read_to_string(path).unwrap(), "in-place\n");
}

#[test]
fn what_is_written_in_place_is_put_back_when_it_fails() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    for new in ["", "x", "as long", "something longer than before"] {
        fs::write(&path, "content").unwrap();
        let mut file = InPlace::new(&path).unwrap();
        assert_eq!(file.write(new.as_bytes()).unwrap(), new.len());
        drop(file);
        assert_eq!(fs::read_to_string(&path).unwrap(), "content");
        let mut file = InPlace::new(&path).unwrap();
        assert_eq!(file.write(new.as_bytes()).unwrap(), new.len());
        assert!(file.finish(true).is_ok());
        assert_eq!(fs::read_to_string(&path).unwrap(), new);
    }
    fs::write(folder.path().join("from"), "copied").unwrap();
    assert!(InPlace::new(&path).unwrap().copy(&folder.path().join("from"), false).is_ok());
    assert_eq!(fs::read_to_string(&path).unwrap(), "copied");
    assert!(InPlace::new(&path).unwrap().copy(&folder.path().join("none"), false).is_err());
    assert_eq!(fs::read_to_string(&path).unwrap(), "copied");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_is_an_error() {
    let error = write(Path::new("/dev/full"), "text").unwrap_err();
    assert!(error.message().starts_with("/dev/full: "), "{error}");
    write(Path::new("/dev/null"), "text").unwrap();
}

#[test]
fn sweeping_removes_old_temporary_files_of_ours_alone() {
    let folder = tempfile::tempdir().unwrap();
    let now = SystemTime::now();
    let add = |name: &str, hours: u64| {
        let path = folder.path().join(name);
        fs::write(&path, "").unwrap();
        let file = File::options().append(true).open(&path).unwrap();
        file.set_modified(now - Duration::from_secs(hours * 3600)).unwrap();
        file
    };
    add(".a.png.aB3dE6gH.anyhit-tmp", 2);
    let held = add(".b.png.aB3dE6gH.anyhit-tmp", 200);
    held.lock().unwrap();
    add(".c.png.aB3dE6gH.anyhit-tmp", 0);
    let foreign = [
        ".a.png.aB3dE6gH.partial",
        ".a.png.aB3dE6g-.anyhit-tmp",
        ".a.png.aB3dE6gHi.anyhit-tmp",
        ".anyhit-tmp",
        ".tmpAbCdEf",
        "a.png.aB3dE6gH.anyhit-tmp",
    ];
    for name in foreign {
        add(name, 200);
    }
    fs::create_dir(folder.path().join(".d.png.aB3dE6gH.anyhit-tmp")).unwrap();
    let later = now + Duration::from_secs(60);
    temporary::sweep(folder.path(), later);
    let mut left = foreign.to_vec();
    let held = [".b.png.aB3dE6gH.anyhit-tmp", ".c.png.aB3dE6gH.anyhit-tmp", ".d.png.aB3dE6gH.anyhit-tmp"];
    left.extend(held);
    left.sort_unstable();
    assert_eq!(names(folder.path()), left);
}

#[test]
fn what_passes_is_tried_again_and_what_stays_is_an_error() {
    let busy = || io::Error::from(ErrorKind::ResourceBusy);
    let mut left = 3;
    let settled = retried_if(
        |error| error.kind() == ErrorKind::ResourceBusy,
        || {
            if left > 0 {
                left -= 1;
                Err(busy())
            } else {
                Ok("done")
            }
        },
    );
    assert_eq!((settled.unwrap(), left), ("done", 0));
    let mut count = 0;
    let settled: io::Result<()> = retried_if(
        |error| error.kind() == ErrorKind::ResourceBusy,
        || {
            count += 1;
            Err(ErrorKind::NotFound.into())
        },
    );
    assert_eq!((settled.unwrap_err().kind(), count), (ErrorKind::NotFound, 1));
    let mut count = 0;
    let settled: io::Result<()> = retried_if(
        |_| true,
        || {
            count += 1;
            Err(busy())
        },
    );
    assert_eq!((settled.unwrap_err().kind(), count), (ErrorKind::ResourceBusy, 11));
}

#[test]
fn a_lock_is_of_the_file_that_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("counter");
    fs::write(&path, "0").unwrap();
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for _ in 0..20 {
                    let lock = FileLock::of(&path).unwrap();
                    let count: u32 = fs::read_to_string(&path).unwrap().parse().unwrap();
                    write_unsynced(&path, (count + 1).to_string()).unwrap();
                    drop(lock);
                }
            });
        }
    });
    assert_eq!(fs::read_to_string(&path).unwrap(), "160");
    assert_eq!(names(folder.path()), ["counter"]);
}
