//! The program under limits of the system: little memory, few threads, no folder for sockets. Linux has the means to set them.

mod skips;

use libtest_mimic::Arguments;
use skips::{Missing, holds};
use std::{fs, process::Command};

const PROGRAM: &str = env!("CARGO_BIN_EXE_hemisplat");
const RENDER: [&str; 8] = ["render", "irradiance", "--scene", "cornell", "--size", "512x512", "-o", "x.exr"];

fn main() {
    let linux = (!cfg!(target_os = "linux")).then(|| Missing::new("tools", "limits are set as on Linux"));
    let trials = vec![
        holds("drivers_do_not_speak_of_folders_that_nobody_asked_for", linux.as_ref(), drivers_do_not_speak_of_folders_that_nobody_asked_for),
        holds("little_memory_is_an_error_in_words", linux.as_ref(), little_memory_is_an_error_in_words),
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
