//! `isoclay devices` where nothing is plugged in, as it is wherever tests run.

use crate::common::Bench;

#[test]
fn devices_are_listed_and_a_system_without_any_is_told_so() {
    let bench = Bench::new();
    let told = bench.json("devices");
    let devices = told["devices"].as_array().unwrap();
    let notes = told["notes"].to_string();
    assert_eq!(told["names"].as_array().unwrap().len(), 5);
    if told["has_hidraw"] == false {
        assert!(
            devices.is_empty() && notes.contains("no raw HID devices"),
            "{notes}"
        );
    } else {
        assert_eq!(
            devices.is_empty(),
            notes.contains("driver for touch") || notes.contains("no HID device")
        );
    }
    let text = bench.run("devices");
    assert_eq!(text.code, 0);
    for name in [
        "spacemouse",
        "haptikfabriken:ARM",
        "pid",
        "script:FILE",
        "sim:DEVICE",
    ] {
        assert!(text.stdout.contains(name), "{}", text.stdout);
    }
}

#[test]
fn the_rules_open_every_kind_of_device_to_who_sits_at_the_machine() {
    let bench = Bench::new();
    let rules = bench.run("devices --udev").stdout;
    for id in ["256f", "046d", "16c0", "0486", "1209", "ffb0", "ffff", "2055"] {
        assert!(rules.contains(&format!("==\"{id}\"")), "{id}: {rules}");
    }
    let acting: Vec<&str> = rules
        .lines()
        .filter(|l| !l.is_empty() && !l.starts_with('#'))
        .collect();
    assert_eq!(acting.len(), 6);
    for rule in acting {
        assert!(
            rule.starts_with("KERNEL==\"hidraw*\", ") && rule.ends_with("TAG+=\"uaccess\""),
            "{rule}"
        );
    }
    assert_eq!(
        bench.json("devices --udev")["udev"].as_str().unwrap().trim(),
        rules.trim()
    );
    assert_eq!(bench.run("devices --udev --test sim:omni").code, 2);
    assert_eq!(bench.run("devices --seconds 3").code, 2);
}

#[test]
fn a_test_shows_where_a_device_is() {
    let bench = Bench::new();
    bench.write("way.txt", "0 0 0 0\n0.2 5 0 0 1\n9 5 0 0 1\n");
    let run = bench.run("devices --test script:way.txt --seconds 1 --json");
    assert_eq!(run.code, 0, "{}", run.stderr);
    let lines: Vec<serde_json::Value> = run
        .stdout
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    let (last, looks) = lines.split_last().unwrap();
    assert!(looks.len() > 2 && last["looks"].as_u64().unwrap() >= looks.len() as u64);
    let end = looks.last().unwrap();
    assert_eq!(end["at"], serde_json::json!([5.0, 0.0, 0.0]));
    assert_eq!(
        (end["buttons"].as_u64(), last["rejected"].as_u64()),
        (Some(1), Some(0))
    );
    let run = bench.run("devices --test sim:omni --seconds 1");
    assert!(run.code == 0 && run.stdout.contains("at ("), "{}", run.stderr);
}

#[test]
fn a_device_that_is_not_there_is_named_and_nobody_is_asked_about_it() {
    let bench = Bench::new();
    if bench.json("devices")["devices"]
        .as_array()
        .is_some_and(|d| !d.is_empty())
    {
        eprintln!("skipped: a device is plugged in");
        return;
    }
    for (name, what) in [
        ("spacemouse", "SpaceMouse"),
        ("pid", "force device"),
        ("haptikfabriken:vintage", "force board"),
    ] {
        let (run, _) = bench.pipe(&format!("devices --test {name} --seconds 1"), b"no\n");
        assert_eq!(run.code, 3);
        assert!(
            run.stderr.contains(&format!("no {what}")) && run.stderr.contains("plug one in"),
            "{}",
            run.stderr
        );
        assert!(!run.stderr.contains("type yes"), "asked about nothing");
    }
    let run = bench.run("devices --test script:nowhere.txt");
    assert!(
        run.code == 3 && run.stderr.contains("check the path"),
        "{}",
        run.stderr
    );
    bench.write("way.txt", "0 0 0\n");
    let run = bench.run("devices --test script:way.txt");
    assert!(run.code == 3 && run.stderr.contains("line 1"), "{}", run.stderr);
}
