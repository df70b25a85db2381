//! The program under limits of the system: little memory, few threads, no folder for sockets. Linux has the means to set them.

mod skips;

use libtest_mimic::Arguments;
use skips::{Missing, holds};
use std::{
    fs,
    process::Command,
    time::{Duration, Instant},
};

const PROGRAM: &str = env!("CARGO_BIN_EXE_hemisplat");
const RENDER: [&str; 8] = ["render", "irradiance", "--scene", "cornell", "--size", "512x512", "-o", "x.exr"];

fn main() {
    let linux = (!cfg!(target_os = "linux")).then(|| Missing::new("tools", "limits are set as on Linux"));
    let trials = vec![
        holds("drivers_do_not_speak_of_folders_that_nobody_asked_for", linux.as_ref(), drivers_do_not_speak_of_folders_that_nobody_asked_for),
        holds("little_memory_is_an_error_in_words", linux.as_ref(), little_memory_is_an_error_in_words),
        holds("long_chains_of_nodes_take_no_longer_than_others", None, long_chains_of_nodes_take_no_longer_than_others),
        holds("a_full_cache_disk_is_told_and_no_work_is_lost", linux.as_ref(), a_full_cache_disk_is_told_and_no_work_is_lost),
        holds("few_threads_are_an_error_in_words", linux.or_else(few_threads_missing).as_ref(), few_threads_are_an_error_in_words),
    ];
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

/// What a command says where it runs under a shell's limits.
fn limited(program: &str, arguments: &[&str], command: &[&str]) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let mut limited = Command::new(program);
    limited.current_dir(folder.path()).env_remove("XDG_RUNTIME_DIR").args(arguments).arg(PROGRAM).args(command);
    let output = limited.output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

fn drivers_do_not_speak_of_folders_that_nobody_asked_for() {
    let (_, message) = limited("env", &[], &["explain", "irradiance", "--scene", "furnace"]);
    assert_eq!(message, "");
}

fn little_memory_is_an_error_in_words() {
    for kibibytes in ["400000", "1060000"] {
        let (status, message) = limited("sh", &["-c", &format!("ulimit -v {kibibytes}; exec \"$0\" \"$@\"")], &RENDER);
        assert_eq!(status, Some(1), "{message}");
        // A GPU's driver does not load in so little.
        assert!(["cli::little_memory", "gpu::no_adapter"].iter().any(|code| message.contains(code)) && message.contains("ulimit -v"), "{message}");
    }
}

/// 100,000 nodes of glTF, each the child of the one before, with a triangle and a camera of its own: a row of equal triangles.
fn long_chains_of_nodes_take_no_longer_than_others() {
    const NODES: usize = 100_000;
    let node = |k: usize| {
        let child = if k + 1 < NODES { format!(r#", "children": [{}]"#, k + 1) } else { String::new() };
        format!(r#"{{"name": "n{k}", "mesh": 0, "camera": 0, "translation": [2, 0, 0]{child}}}"#)
    };
    let nodes = (0..NODES).map(node).collect::<Vec<_>>().join(",");
    let scene = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}],
        "cameras": [{{"type": "perspective", "perspective": {{"yfov": 0.7, "znear": 0.1}}}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
        "buffers": [{{"byteLength": 36, "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}]}}"#
    );
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("chain.gltf"), scene).unwrap();
    let start = Instant::now();
    let output = Command::new(PROGRAM).current_dir(folder.path()).args(["explain", "irradiance", "--scene", "chain.gltf", "--size", "8x8"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    // A second; names alone took 20 s, the hierarchy more than 40.
    assert!(start.elapsed() < Duration::from_secs(15), "{:?}", start.elapsed());
}

/// A limit on the size of files stands for a full disk: the reference has to be larger than what tells of it.
fn a_full_cache_disk_is_told_and_no_work_is_lost() {
    let shell = "trap '' XFSZ; ulimit -f 64; XDG_CACHE_HOME=\"$PWD/cache\" exec \"$0\" \"$@\"";
    let compare = "compare irradiance --scene cornell --size 64x64 --runs 2 --reference-spp 2 --json -";
    let (status, message) = limited("sh", &["-c", shell], &compare.split(' ').collect::<Vec<_>>());
    if message.contains("gpu::no_adapter") {
        return;
    }
    assert_eq!(status, Some(0), "{message}");
    // Lines are broken where the folder's name lets them.
    let words = message.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(["compare::not_kept", "File too large", "--reference-cache"].iter().all(|told| words.contains(told)), "{message}");
    // Where no file can be made at all, it is told before a path is traced.
    let shell = "touch cache; XDG_CACHE_HOME=\"$PWD/cache\" exec \"$0\" \"$@\"";
    let (status, message) = limited("sh", &["-c", shell], &compare.split(' ').collect::<Vec<_>>());
    assert_eq!(status, Some(1), "{message}");
    assert!(message.contains("compare::unusable_cache") && message.contains("--reference-cache"), "{message}");
}

/// Who runs a program with four threads at most. Limits on processes do not hold for the super-user.
fn four_threads() -> Vec<&'static str> {
    let is_root = fs::read_to_string("/proc/self/status").unwrap_or_default().contains("\nUid:\t0\t");
    let nobody: &[&str] = if is_root { &["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"] } else { &[] };
    [nobody, &["prlimit", "--nproc=4"]].concat()
}

/// Why such a limit cannot be set here, if it cannot.
fn few_threads_missing() -> Option<Missing> {
    let command = four_threads();
    let why = match Command::new(command[0]).args(&command[1..]).args([PROGRAM, "--version"]).output() {
        Err(_) => format!("the program `{}` is missing", command[0]),
        Ok(output) if String::from_utf8_lossy(&output.stderr).contains("failed to execute") => "a user without rights cannot run the built program".into(),
        Ok(_) => return None,
    };
    Some(Missing::new("tools", why))
}

fn few_threads_are_an_error_in_words() {
    let command = four_threads();
    let (status, message) = limited(command[0], &command[1..], &RENDER);
    assert_eq!(status, Some(1), "{message}");
    // A user with other processes gets not even the thread that listens to Ctrl-C.
    assert!(message.contains("cli::few_threads") || message.contains("cli::signal"), "{message}");
    assert!(message.contains("ulimit -u"), "{message}");
}
