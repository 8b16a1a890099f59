//! What `btr new` says of files that it cannot make a model of.

use crate::lab::{Lab, text};

const BODY: &str = "<inertial><mass value=\"1\"/><origin xyz=\"0 0 0.3\"/>\
                    <inertia ixx=\"0.1\" iyy=\"0.1\" izz=\"0.1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";

fn link(name: &str) -> String {
    format!("<link name=\"{name}\">{BODY}</link>\n")
}

fn hinge(name: &str, parent: &str, child: &str) -> String {
    format!("<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/></joint>\n")
}

fn robot(parts: &[String]) -> String {
    format!("<robot name=\"r\">\n{}</robot>\n", parts.concat())
}

/// The complaint about a file; nothing is written.
fn about(lab: &Lab, file: &str, content: impl AsRef<[u8]>) -> String {
    std::fs::write(lab.path(file), content).unwrap();
    let told = lab.complaint(&format!("new {file} -o out.toml"));
    assert!(!lab.exists("out.toml") && !lab.exists("out.urdf"), "{file}");
    told
}

#[test]
fn robots_that_are_no_trees_of_bodies() {
    let (lab, [a, b, c]) = (Lab::new(), ["a", "b", "c"].map(link));
    let [ab, bc, ca] = [("ab", "a", "b"), ("bc", "b", "c"), ("ca", "c", "a")].map(|(n, p, q)| hinge(n, p, q));
    let told = [
        ("no_root.urdf", robot(&[a.clone(), b.clone(), c.clone(), ab.clone(), bc.clone(), ca])),
        ("loop.urdf", robot(&[a.clone(), b.clone(), c.clone(), ab.clone(), bc, hinge("ac", "a", "c")])),
        ("roots.urdf", robot(&[a.clone(), b.clone(), c, ab.clone()])),
        ("links.urdf", robot(&[a.clone(), b.clone(), b.clone(), ab.clone()])),
        ("joints.urdf", robot(&[a.clone(), b, ab.clone(), ab.clone()])),
        ("gone.urdf", robot(&[a.clone(), ab.clone()])),
        ("massless.urdf", robot(&[a.clone(), "<link name=\"b\"/>\n".to_owned(), ab])),
        ("still.urdf", robot(&[a])),
        ("empty.urdf", robot(&[])),
        ("name.urdf", robot(&[link("world"), link("left,right"), hinge("left,right", "world", "left,right")])),
    ];
    let told = told.map(|(file, urdf)| about(&lab, file, urdf));
    insta::assert_snapshot!("new_no_trees", told.join("\n"));
}

#[test]
fn files_of_other_formats() {
    let lab = Lab::new();
    let sdf = "<?xml version=\"1.0\"?>\n<!-- a world -->\n<sdf version=\"1.6\"><model name=\"m\"/></sdf>";
    std::fs::create_dir(lab.path("folder.urdf")).unwrap();
    let told = [
        about(&lab, "text.urdf", "a robot"),
        about(&lab, "cut.urdf", "<robot name=\"r\">\n<link name=\"a\">\n</robot>"),
        about(&lab, "binary.urdf", b"\x00\xff\xfe"),
        about(&lab, "robot.sdf", sdf),
        about(&lab, "sdf.xml", sdf),
        about(&lab, "sdf.urdf", sdf),
        about(&lab, "robot.usd", b"PXR-USDC\0\0"),
        about(&lab, "usd.urdf", "#usda 1.0\n"),
        about(&lab, "robot.srdf", "<robot name=\"r\"/>"),
        about(&lab, "base.stl", "solid"),
        about(&lab, "other.xml", "<launch/>"),
        lab.complaint("new folder.urdf -o out.toml"),
    ];
    insta::assert_snapshot!("new_other_formats", told.join("\n"));
}

/// `python3`, and a program `xacro`, that say something on stderr and fail.
#[cfg(unix)]
#[test]
fn xacro_that_is_not_there_or_fails() {
    use std::os::unix::fs::PermissionsExt;
    let lab = Lab::new();
    lab.write("arm.xacro", "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\"/>");
    let program = |folder: &str, name: &str, script: &str| {
        std::fs::create_dir_all(lab.path(folder)).unwrap();
        let path = format!("{folder}/{name}");
        lab.write(&path, &format!("#!/bin/sh\n{script}\n"));
        std::fs::set_permissions(lab.path(&path), std::fs::Permissions::from_mode(0o755)).unwrap();
    };
    let told = |folder: &str| {
        let mut command = lab.command("new arm.xacro -o out.toml");
        command.env("PATH", lab.path(folder)).env("BTR_PYTHON", "python3");
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(!lab.exists("out.toml") && !lab.exists("out.urdf"));
        text(&output.stderr)
    };
    program("without", "python3", "echo \"Traceback\nModuleNotFoundError: No module named 'xacro'\" >&2; exit 1");
    program("fails", "xacro", "echo 'error: Undefined substitution argument x' >&2; exit 2");
    program("breaks", "xacro", "echo '<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/></robot>'");
    insta::assert_snapshot!("new_xacro", ["nothing", "without", "fails", "breaks"].map(told).join("\n"));
}
