//! Files of others stay, results are whole or not there, and what is left unfinished is put right.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use moiregauge_pipeline::sink::{
    FileSink, FolderSink, MANIFEST, Manifest, OneFile, Part, SinkError, Target, UNFINISHED,
};

/// Every file below a folder, by name.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    let Ok(entries) = std::fs::read_dir(folder) else {
        return all;
    };
    for entry in entries {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            let inner = contents(&path);
            all.extend(inner.into_iter().map(|(n, b)| (format!("{name}/{n}"), b)));
        } else {
            all.insert(name, std::fs::read(&path).unwrap());
        }
    }
    all
}

fn open_kind(folder: &Path, kind: &str, force: bool) -> Result<FolderSink, SinkError> {
    FolderSink::open(&Target {
        folder,
        kind,
        names: &["results.json".to_owned(), "figures/".to_owned()],
        inputs: &[],
        force,
    })
}

fn open(folder: &Path, force: bool) -> Result<FolderSink, SinkError> {
    open_kind(folder, "analyze", force)
}

/// Writes results whose files hold `text`.
fn write(folder: &Path, force: bool, names: &[&str], text: &str) {
    let sink = open(folder, force).unwrap();
    for name in names {
        sink.write(name, text.as_bytes()).unwrap();
    }
    sink.commit().unwrap();
}

const OLD: [&str; 3] = ["results.json", "figures/a.svg", "figures/old/b.svg"];
const NEW: [&str; 2] = ["results.json", "figures/a.svg"];

#[test]
fn nothing_is_at_its_place_before_the_end_and_the_list_is_that_of_the_files() {
    let work = tempfile::tempdir().unwrap();
    let folder = work.path().join("deep/results");
    let sink = open(&folder, false).unwrap();
    sink.write("results.json", b"abc").unwrap();
    assert!(!folder.join("results.json").exists());
    sink.commit().unwrap();
    let there: Vec<String> = contents(&folder).into_keys().collect();
    assert_eq!(there, [MANIFEST, "results.json"]);
    let list = Manifest::read(&folder).unwrap().unwrap();
    assert_eq!(list.kind, "analyze");
    // SHA-256 of "abc", FIPS 180-2, appendix B.1.
    let hash = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    assert_eq!(
        (list.files[0].bytes, list.files[0].sha256.as_str()),
        (3, hash)
    );
}

/// A run that gives up leaves no trace, not even the folders that it made.
#[test]
fn a_run_that_gives_up_leaves_everything_as_it_was() {
    let work = tempfile::tempdir().unwrap();
    let sink = open(&work.path().join("deep/results"), false).unwrap();
    sink.write("results.json", b"new").unwrap();
    drop(sink);
    assert!(!work.path().join("deep").exists());

    let folder = work.path().join("there");
    write(&folder, false, &OLD, "old");
    let before = contents(&folder);
    let sink = open(&folder, true).unwrap();
    sink.write("figures", b"new").unwrap();
    // A disk that is full, a name that cannot be: what is written before counts for nothing.
    assert!(sink.write("figures/a.svg", b"new").is_err());
    drop(sink);
    assert_eq!(contents(&folder), before);
}

#[test]
fn force_replaces_what_is_listed_and_leaves_what_is_not() {
    let work = tempfile::tempdir().unwrap();
    let folder = work.path().join("results");
    write(&folder, false, &OLD, "old");
    std::fs::write(folder.join("figures/mine.svg"), "mine").unwrap();
    std::fs::write(folder.join("notes.txt"), "mine").unwrap();
    assert!(matches!(open(&folder, false), Err(SinkError::Holds { .. })));
    write(&folder, true, &NEW, "new");
    let now = contents(&folder);
    let names: Vec<&String> = now.keys().collect();
    let all = [
        "figures/a.svg",
        "figures/mine.svg",
        MANIFEST,
        "notes.txt",
        "results.json",
    ];
    assert_eq!(names, all);
    assert_eq!(now["figures/a.svg"], b"new");
    assert_eq!(now["figures/mine.svg"], b"mine");
    assert!(
        !folder.join("figures/old").exists(),
        "an empty folder of ours goes"
    );
}

#[test]
fn what_was_changed_is_named_and_kept() {
    let work = tempfile::tempdir().unwrap();
    let folder = work.path().join("results");
    write(&folder, false, &OLD, "old");
    std::fs::write(folder.join("figures/old/b.svg"), "changed").unwrap();
    let before = contents(&folder);
    let error = open(&folder, true).unwrap_err();
    assert!(matches!(error, SinkError::Changed(_)), "{error}");
    assert!(error.to_string().contains("b.svg"), "{error}");
    assert_eq!(contents(&folder), before);
    // While the run works, too.
    std::fs::write(folder.join("figures/old/b.svg"), "old").unwrap();
    let sink = open(&folder, true).unwrap();
    sink.write("results.json", b"new").unwrap();
    std::fs::write(folder.join("results.json"), "changed").unwrap();
    assert!(matches!(sink.commit(), Err(SinkError::Changed(_))));
    assert_eq!(contents(&folder)["results.json"], b"changed");
}

#[test]
fn names_that_others_have_are_found_before_the_work() {
    let work = tempfile::tempdir().unwrap();
    for force in [false, true] {
        let folder = work.path().join("results");
        std::fs::create_dir_all(folder.join("figures")).unwrap();
        std::fs::write(folder.join("results.json"), "{\"mine\": 1}").unwrap();
        let error = open(&folder, force).unwrap_err();
        assert!(matches!(error, SinkError::Foreign(_)), "{error}");
        std::fs::remove_file(folder.join("results.json")).unwrap();
        open(&folder, force).unwrap();
    }
}

#[test]
fn results_of_another_kind_stay() {
    let work = tempfile::tempdir().unwrap();
    let folder = work.path().join("results");
    write(&folder, false, &OLD, "old");
    for force in [false, true] {
        let error = open_kind(&folder, "map", force).unwrap_err();
        assert!(matches!(error, SinkError::OtherKind { .. }), "{error}");
        assert!(error.to_string().contains("analyze"), "{error}");
    }
}

/// Results without a list are known by their document; force replaces the very names and nothing else.
#[test]
fn results_of_versions_without_a_list() {
    let work = tempfile::tempdir().unwrap();
    let document = r#"{"schema": "moiregauge/results/1"}"#;
    std::fs::create_dir(work.path().join("figures")).unwrap();
    std::fs::write(work.path().join("results.json"), document).unwrap();
    std::fs::write(work.path().join("figures/z.svg"), "old").unwrap();
    assert!(matches!(
        open(work.path(), false),
        Err(SinkError::Holds { .. })
    ));
    assert!(matches!(
        open_kind(work.path(), "map", true),
        Err(SinkError::OtherKind { .. })
    ));
    write(work.path(), true, &NEW, "new");
    let now = contents(work.path());
    assert_eq!(now["results.json"], b"new");
    assert_eq!(now["figures/z.svg"], b"old");
}

#[test]
fn inputs_are_never_replaced() {
    let work = tempfile::tempdir().unwrap();
    let folder = work.path().join("results");
    write(&folder, false, &["results.json", "corrected/a.gwy"], "old");
    let inputs = [work.path().join("results/../results/corrected/a.gwy")];
    let target = Target {
        folder: &folder,
        kind: "analyze",
        names: &[],
        inputs: &inputs,
        force: true,
    };
    let error = FolderSink::open(&target).unwrap_err();
    assert!(matches!(error, SinkError::Input(_)), "{error}");
    assert_eq!(contents(&folder)["corrected/a.gwy"], b"old");
}

#[test]
fn one_run_at_a_time() {
    let work = tempfile::tempdir().unwrap();
    let first = open(work.path(), false).unwrap();
    let error = open(work.path(), true).unwrap_err();
    assert!(matches!(error, SinkError::Running(_)), "{error}");
    drop(first);
    open(work.path(), false).unwrap();
    // What a killed run leaves has a lock that nobody holds.
    let left = work.path().join(UNFINISHED);
    std::fs::create_dir_all(left.join("new/figures")).unwrap();
    std::fs::write(left.join("lock"), "").unwrap();
    std::fs::write(left.join("new/figures/a.svg"), "half").unwrap();
    write(work.path(), false, &["results.json"], "new");
    let there: Vec<String> = contents(work.path()).into_keys().collect();
    assert_eq!(there, [MANIFEST, "results.json"]);
    // A folder of that name that is somebody's is not ours.
    let other = tempfile::tempdir().unwrap();
    std::fs::create_dir(other.path().join(UNFINISHED)).unwrap();
    let mine = other.path().join(UNFINISHED).join("mine");
    std::fs::write(&mine, "mine").unwrap();
    assert!(matches!(
        open(other.path(), true),
        Err(SinkError::Foreign(_))
    ));
    assert!(mine.exists());
}

/// Moving stops in the middle: the next run completes it, whatever it wants itself.
#[test]
fn what_stopped_in_the_middle_is_completed() {
    let work = tempfile::tempdir().unwrap();
    let folder = work.path().join("results");
    write(&folder, false, &["results.json", "stale.csv"], "old");
    let sink = open(&folder, true).unwrap();
    for name in ["a.csv", "figures/a.svg", "results.json"] {
        sink.write(name, b"new").unwrap();
    }
    // Comes between: a file where a folder has to be.
    std::fs::write(folder.join("figures"), "in the way").unwrap();
    let error = sink.commit().unwrap_err();
    assert!(matches!(error, SinkError::Unfinished { .. }), "{error}");
    assert!(!folder.join("stale.csv").exists() && folder.join("a.csv").exists());
    assert_eq!(std::fs::read(folder.join("results.json")).unwrap(), b"old");
    // Still in the way: nothing is lost.
    assert!(open(&folder, false).is_err());
    std::fs::remove_file(folder.join("figures")).unwrap();
    assert!(matches!(open(&folder, false), Err(SinkError::Holds { .. })));
    let now = contents(&folder);
    let names: Vec<&String> = now.keys().collect();
    assert_eq!(names, ["a.csv", "figures/a.svg", MANIFEST, "results.json"]);
    assert_eq!(now["results.json"], b"new");
    let list = Manifest::read(&folder).unwrap().unwrap();
    assert_eq!(list.files.len(), 3);
}

#[test]
fn parts_outlive_their_run_and_show_damage() {
    let work = tempfile::tempdir().unwrap();
    let sink = open(work.path(), false).unwrap();
    sink.keep("one", b"12345").unwrap();
    drop(sink);
    let sink = open(work.path(), false).unwrap();
    assert_eq!(sink.kept("one"), Part::Whole(b"12345".to_vec()));
    assert_eq!(sink.kept("two"), Part::Absent);
    let path = work.path().join(UNFINISHED).join("parts/one");
    let whole = std::fs::read(&path).unwrap();
    for bit in 0..8 * whole.len() {
        let mut flipped = whole.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        std::fs::write(&path, flipped).unwrap();
        assert_eq!(sink.kept("one"), Part::Damaged);
    }
    std::fs::write(&path, &whole[..20]).unwrap();
    assert_eq!(sink.kept("one"), Part::Damaged);
    sink.write("results.json", b"new").unwrap();
    sink.commit().unwrap();
    assert!(!work.path().join(UNFINISHED).exists());
}

#[test]
fn lists_that_lead_out_of_the_folder_are_refused() {
    let work = tempfile::tempdir().unwrap();
    let folder = work.path().join("results");
    write(&folder, false, &["results.json"], "old");
    std::fs::write(work.path().join("mine"), "old").unwrap();
    let list = std::fs::read_to_string(folder.join(MANIFEST)).unwrap();
    std::fs::write(
        folder.join(MANIFEST),
        list.replace("results.json", "../mine"),
    )
    .unwrap();
    assert!(matches!(
        open(&folder, true),
        Err(SinkError::Manifest { .. })
    ));
    assert!(work.path().join("mine").exists());
    let sink = open(&work.path().join("other"), false).unwrap();
    assert!(matches!(
        sink.write("../mine", b"x"),
        Err(SinkError::Name { .. })
    ));
}

#[test]
fn single_files_are_whole_and_ask_first() {
    let work = tempfile::tempdir().unwrap();
    let path = work.path().join("new/scanner.toml");
    let file = OneFile::open(&path, false, &[]).unwrap();
    assert!(!path.exists());
    file.write(b"one".to_vec()).unwrap();
    assert!(matches!(
        OneFile::open(&path, false, &[]),
        Err(SinkError::Exists(_))
    ));
    OneFile::open(&path, true, &[])
        .unwrap()
        .write(b"two".to_vec())
        .unwrap();
    let there: Vec<String> = contents(work.path()).into_keys().collect();
    assert_eq!(there, ["new/scanner.toml"]);
    // Nothing was written: the folder goes.
    drop(OneFile::open(&work.path().join("none/a"), false, &[]).unwrap());
    assert!(!work.path().join("none").exists());
    // A file where a folder has to be is found at once.
    assert!(OneFile::open(&path.join("a"), true, &[]).is_err());
    assert!(matches!(
        OneFile::open(work.path(), true, &[]),
        Err(SinkError::NoFile(_))
    ));
}

#[test]
fn inputs_are_known_by_any_name() {
    let work = tempfile::tempdir().unwrap();
    let raw = work.path().join("raw.gwy");
    std::fs::write(&raw, "raw").unwrap();
    let inputs = [raw.clone()];
    let mut names = vec![
        raw.clone(),
        work.path()
            .join("../")
            .join(work.path().file_name().unwrap())
            .join("raw.gwy"),
    ];
    #[cfg(unix)]
    {
        let (link, hard) = (work.path().join("link.gwy"), work.path().join("hard.gwy"));
        std::os::unix::fs::symlink(&raw, &link).unwrap();
        std::fs::hard_link(&raw, &hard).unwrap();
        names.extend([link, hard]);
    }
    for name in names {
        let error = OneFile::open(&name, true, &inputs).unwrap_err();
        assert!(
            matches!(error, SinkError::Input(_)),
            "{}: {error}",
            name.display()
        );
    }
    assert_eq!(std::fs::read(&raw).unwrap(), b"raw");
}

#[test]
fn groups_are_replaced_as_a_whole_if_they_are_ours() {
    let work = tempfile::tempdir().unwrap();
    let name = Path::new("a.zarr");
    let file = |name: &str, text: &str| (name.to_owned(), text.as_bytes().to_vec());
    let group = r#"{"attributes": {"log": ["converted by moiregauge 0.1.0"]}}"#;
    let sink = FileSink::open(work.path(), true, &[]).unwrap();
    sink.write_group(
        name,
        &[file("zarr.json", group), file("old/zarr.json", "{}")],
    )
    .unwrap();
    sink.write_group(name, &[file("zarr.json", group)]).unwrap();
    drop(sink);
    let there: Vec<String> = contents(work.path()).into_keys().collect();
    assert_eq!(there, ["a.zarr/zarr.json"]);
    std::fs::write(work.path().join("a.zarr/zarr.json"), "{}").unwrap();
    let sink = FileSink::open(work.path(), true, &[]).unwrap();
    let error = sink
        .write_group(name, &[file("zarr.json", group)])
        .unwrap_err();
    assert!(matches!(error, SinkError::Foreign(_)), "{error}");
}

/// A run was killed while it replaced a group and wrote a file: the group comes back, the rest is swept up.
#[test]
fn what_killed_runs_leave_beside_files_is_put_right() {
    let work = tempfile::tempdir().unwrap();
    let left = work.path().join(format!("{UNFINISHED}-1-0"));
    std::fs::create_dir_all(left.join("old/a.zarr")).unwrap();
    std::fs::create_dir_all(left.join("new")).unwrap();
    std::fs::write(left.join("lock"), "").unwrap();
    std::fs::write(left.join("old/a.zarr/zarr.json"), "old").unwrap();
    std::fs::write(left.join("new/0"), "half").unwrap();
    let others = work.path().join(format!("{UNFINISHED}-mine"));
    std::fs::create_dir(&others).unwrap();
    std::fs::write(others.join("mine"), "mine").unwrap();
    drop(FileSink::open(work.path(), false, &[]).unwrap());
    let there: Vec<String> = contents(work.path()).into_keys().collect();
    let mine = format!("{UNFINISHED}-mine/mine");
    assert_eq!(there, ["a.zarr/zarr.json".to_owned(), mine]);
    // One that is at work is left alone.
    let first = FileSink::open(work.path(), false, &[]).unwrap();
    let second = FileSink::open(work.path(), false, &[]).unwrap();
    let named = |name: &str| vec![(PathBuf::from(name), b"x".to_vec())];
    first.write(&named("1")).unwrap();
    second.write(&named("2")).unwrap();
}
