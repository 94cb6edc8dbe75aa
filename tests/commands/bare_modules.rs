//! `anyhit run MODULE`: errors and notes speak of the flags that the user wrote, never of the scene
//! that is made from them.

use crate::support::program::anyhit;

const SUMS: &str = "spirv-fixtures/pass/compute/prefix-sum/main.comp.spv";
const PRINT: &str = "spirv-fixtures/pass/compute/print/main.comp.spv";

#[test]
fn a_default_that_is_too_large_names_its_flags() {
    let ran = anyhit(&["run", SUMS, "--groups", "2000000"]);
    assert_eq!(ran.code, Some(5), "{}", ran.err);
    for part in [
        // 256 invocations in each group, 4 bytes for each.
        "2048000000 bytes of a buffer exceed the limit `buffer-bytes` of 1073741824",
        "`Outputs` at set 0, binding 1",
        "512000000 invocations of `--groups 2000000`",
        "set its size with `--buffer 0,1=SIZE`",
        "raise it with `--limit buffer-bytes=N`",
    ] {
        assert!(ran.err.contains(part), "`{part}` is missing in {}", ran.err);
    }
    assert!(!ran.err.contains("the command line:") && !ran.err.contains("launch"), "{}", ran.err);
}

#[test]
fn a_dispatch_that_is_too_large_names_its_flag() {
    let ran = anyhit(&["run", SUMS, "--groups", "100000000", "--buffer", "1=64"]);
    assert_eq!(ran.code, Some(2), "{}", ran.err);
    assert!(ran.err.contains("`--groups 100000000`"), "{}", ran.err);
    assert!(ran.out.is_empty(), "{}", ran.out);
}

#[test]
fn what_a_flag_says_is_shown_in_the_flag() {
    for (arguments, shown) in [
        (["--buffer", "1=u32=[1,x]"], "--buffer 1=u32=[1,x]"),
        (["--buffer", "1@123=64"], "--buffer 1@123=64"),
        (["--buffer", "more@123=64"], "--buffer more@123=64"),
        (["--buffer", "1=missing.bin"], "--buffer 1=missing.bin"),
        (["--push", "u33 = 1"], "--push u33 = 1"),
    ] {
        let ran = anyhit(&["run", SUMS, arguments[0], arguments[1]]);
        assert_eq!(ran.code, Some(2), "{arguments:?}: {}", ran.err);
        assert!(ran.err.contains(&format!("\n1 │ {shown}\n")), "{arguments:?}: {}", ran.err);
        assert!(!ran.err.contains("\n14 │") && !ran.err.contains("[resources"), "{arguments:?}: {}", ran.err);
    }
}

/// One command serves several modules, some of which use less than it says.
#[test]
fn what_a_module_does_not_use_is_a_note() {
    let plain = anyhit(&["run", SUMS]);
    for (flag, value, note) in [
        ("--buffer", "7=16", "`--buffer 7=16`: `main` does not use set 0, binding 7"),
        ("--buffer", "2,1=f32=[1]", "`--buffer 2,1=f32=[1]`: `main` does not use set 2, binding 1"),
        ("--image", "7=4x4", "`--image 7=4x4`: `main` does not use set 0, binding 7"),
        ("--push", "u32 = 3", "`--push u32 = 3`: `main` has no push constants"),
        // VkSpecializationMapEntry: it "does not affect the behavior of the pipeline".
        ("--spec", "3=1", "`--spec 3=1`: the module has no specialization constant 3"),
    ] {
        let ran = anyhit(&["run", SUMS, flag, value]);
        assert_eq!((ran.code, &ran.out), (Some(0), &plain.out), "{flag} {value}: {}", ran.err);
        assert_eq!(ran.err, format!("note: {note}\n"));
    }
    // A name that is misspelt is no number of another module.
    let ran = anyhit(&["run", SUMS, "--spec", "width=1"]);
    assert!(ran.code == Some(2) && ran.err.contains("named `width`"), "{}", ran.err);
}

/// The workgroups of the shader are as wide as constant 0 says, and its buffer is as long by
/// default.
#[test]
fn sizes_follow_constants_in_every_spelling() {
    let run =
        |value: &str| anyhit(&["run", "spirv-fixtures/pass/compute/builtins/main.comp.spv", "--spec", value]);
    // Each invocation has one element, and stores more.
    let decimal = run("0=8");
    assert!(decimal.err.contains("which has 16 elements in this buffer"), "{}", decimal.err);
    for value in ["0=0x8", "0=0b1000", "0={ u32 = 8 }", "0 = +8"] {
        let ran = run(value);
        assert_eq!((ran.code, ran.out, ran.err), (decimal.code, decimal.out.clone(), decimal.err.clone()));
    }
}

#[test]
fn every_command_calls_a_limit_so() {
    const SCENE: &str = "shaders/pass/compute/prefix-sum/scene.toml";
    for arguments in [&["smoke", SUMS][..], &["run", SUMS], &["run", SCENE]] {
        let ran = anyhit(&[arguments, &["--limit", "registers=1"]].concat());
        assert_eq!(ran.code, Some(5), "{arguments:?}: {}{}", ran.out, ran.err);
        let text = ran.out + &ran.err;
        assert!(
            text.contains("limit `registers` of 1") && !text.contains("a limitation of anyhit"),
            "{text}"
        );
    }
    let ran = anyhit(&["smoke", SUMS, "--json", "--limit", "registers=1"]);
    let json: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON");
    assert_eq!(
        (&json["entry_points"][0]["result"], &json["errors"][0]["class"]),
        (&"limit".into(), &"limit".into())
    );
    let both = anyhit(&["smoke", SUMS, PRINT, "--limit", "registers=1"]);
    assert_eq!(both.code, Some(5), "{}", both.err);
    assert!(both.out.contains("2 modules: 2 limit"), "{}", both.out);
}
