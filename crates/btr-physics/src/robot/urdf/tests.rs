#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
use super::*;
use nalgebra::vector;

const BODY: &str = r#"<inertial><origin xyz="0 0 0.1"/><mass value="2"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="2" iyz="0" izz="3"/></inertial>"#;

fn link_text(name: &str) -> String {
    format!("<link name=\"{name}\">{BODY}</link>")
}

fn joint_text(name: &str, kind: &str, parent: &str, child: &str, inside: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{inside}</joint>"
    )
}

fn robot_text(parts: &[String]) -> String {
    format!("<robot name=\"r\">{}</robot>", parts.concat())
}

fn error_of(parts: &[String]) -> String {
    parse_urdf(&robot_text(parts), Base::Fixed).unwrap_err().to_string()
}

fn hinge(inside: &str) -> (Joint, Vec<UrdfWarning>) {
    let parts = [link_text("a"), link_text("b"), joint_text("ab", "revolute", "a", "b", inside)];
    let (mut robot, warnings) = parse_urdf(&robot_text(&parts), Base::Fixed).unwrap();
    (robot.links.remove(1).joint, warnings)
}

#[test]
fn a_joint_keeps_its_dynamics_limits_and_axis() {
    let (joint, warnings) = hinge(
        r#"<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><axis xyz="0 0 2"/><dynamics damping="0.5" friction="0.25"/>
           <limit lower="0.5" upper="2" effort="10" velocity="3"/>"#,
    );
    assert_eq!(joint.axis, vector![0.0, 0.0, 1.0]);
    assert_eq!((joint.damping, joint.dry_friction, joint.limits), (0.5, 0.25, (0.5, 2.0)));
    assert_eq!(joint.speed_limit.to_bits(), 3.0_f64.to_bits());
    assert_eq!(joint.start.to_bits(), 0.5_f64.to_bits(), "the start lies inside the limits");
    assert_eq!(joint.origin.translation.vector, vector![1.0, 2.0, 3.0]);
    // Roll about x first, then pitch about y, then yaw about z, all in the parent's axes.
    let about = |axis: Vector3<f64>, angle| UnitQuaternion::from_scaled_axis(axis * angle);
    let turn = about(Vector3::z(), 0.3) * about(Vector3::y(), 0.2) * about(Vector3::x(), 0.1);
    assert!(joint.origin.rotation.angle_to(&turn) < 1e-15);
    assert_eq!((joint.actuator, warnings), (Actuator::Passive, vec![]));
}

#[test]
fn a_turned_inertial_gives_the_inertia_in_the_links_axes() {
    let turned = BODY.replace("0 0 0.1\"", "0 0 0.1\" rpy=\"1.5707963267948966 0 0\"");
    let (robot, _) = parse_urdf(&robot_text(&[format!("<link name=\"a\">{turned}</link>")]), Base::Floating).unwrap();
    let expected = Matrix3::from_diagonal(&vector![1.0, 3.0, 2.0]);
    assert!((robot.links[0].inertia_kg_m2 - expected).norm() < 1e-15);
    assert_eq!((robot.links[0].com_m.z, robot.mass_kg()), (0.1, 2.0));
}

#[test]
fn parents_come_before_children_whatever_the_files_order() {
    let parts = [
        link_text("hand"),
        link_text("arm"),
        link_text("root"),
        joint_text("wrist", "continuous", "arm", "hand", ""),
        joint_text("shoulder", "fixed", "root", "arm", ""),
    ];
    let (robot, _) = parse_urdf(&robot_text(&parts), Base::Fixed).unwrap();
    let order: Vec<_> = robot.links.iter().map(|l| (l.name.as_str(), l.parent)).collect();
    assert_eq!(order, [("root", None), ("arm", Some(0)), ("hand", Some(1))]);
    assert_eq!(robot.links[2].joint.limits, (f64::NEG_INFINITY, f64::INFINITY));
}

#[test]
fn missing_limits_and_meshes_are_warned_about() {
    let (joint, warnings) = hinge("");
    assert_eq!(joint.limits, (f64::NEG_INFINITY, f64::INFINITY));
    assert_eq!(warnings, [UrdfWarning::NoLimits { joint: "ab".into() }]);
    let mesh = "<link name=\"a\"><collision><geometry><mesh filename=\"a.stl\"/></geometry></collision></link>";
    let (robot, warnings) = parse_urdf(&robot_text(&[mesh.into()]), Base::Fixed).unwrap();
    assert!(robot.links[0].shapes.is_empty());
    assert_eq!(warnings[0].to_string(), "link `a`: contacts of the mesh `a.stl`; only primitives have contacts");
    let point =
        BODY.replace("ixx=\"1\"", "ixx=\"0\"").replace("iyy=\"2\"", "iyy=\"0\"").replace("izz=\"3\"", "izz=\"0\"");
    let (_, warnings) = parse_urdf(&robot_text(&[format!("<link name=\"a\">{point}</link>")]), Base::Fixed).unwrap();
    assert_eq!(warnings, [UrdfWarning::PointMass { link: "a".into() }]);
}

#[test]
fn a_follower_of_a_follower_follows_its_leader() {
    let mimics = |leader: &str, numbers: &str| format!("<mimic joint=\"{leader}\" {numbers}/>");
    let parts = |last: &str| {
        let links = ["a", "b", "c", "d"].map(link_text);
        let ab = joint_text("ab", "continuous", "a", "b", last);
        let bc = joint_text("bc", "continuous", "b", "c", &mimics("ab", "multiplier=\"-2\" offset=\"0.5\""));
        let cd = joint_text("cd", "continuous", "c", "d", &mimics("bc", "multiplier=\"3\""));
        [links.to_vec(), vec![ab, bc, cd]].concat()
    };
    let (robot, warnings) = parse_urdf(&robot_text(&parts("")), Base::Fixed).unwrap();
    assert_eq!(warnings, []);
    let follows: Vec<_> = robot.followers().into_iter().map(|f| (f.joint, f.leader, f.ratio, f.offset)).collect();
    assert_eq!(follows, [(1, 0, -2.0, 0.5), (2, 0, -6.0, 1.5)]);
    let (again, _) = parse_urdf(&to_urdf(&robot), Base::Fixed).unwrap();
    assert_eq!(again.links[2].joint.mimic, robot.links[2].joint.mimic);
    assert_eq!(error_of(&parts(&mimics("cd", ""))), "joint `ab` mimics `cd`, which follows it in turn");
    assert_eq!(
        error_of(&parts(&mimics("ef", ""))),
        "joint `ab` mimics `ef`, which does not exist, or follows one that does not"
    );
}

#[test]
fn invalid_robots_are_described_by_name() {
    let [a, b] = ["a", "b"].map(link_text);
    let ab = |kind: &str| joint_text("ab", kind, "a", "b", "");
    assert_eq!(
        error_of(&[a.clone(), b.clone(), ab("floating")]),
        "joint `ab`: floating joints are not simulated; split it into hinges and slides"
    );
    assert_eq!(error_of(&[a.clone(), ab("fixed")]), "joint `ab` names the link `b`, which does not exist");
    assert_eq!(error_of(&[a.clone(), a.clone()]), "two links are called `a`");
    assert_eq!(error_of(&[a.clone(), b.clone()]), "2 links have no parent (a, b); a robot has one root");
    assert_eq!(error_of(&[]), "there is no <link> in the <robot>");
    assert_eq!(
        error_of(&[a.clone(), b.clone(), ab("fixed"), joint_text("ba", "fixed", "a", "b", "")]),
        "link `b` is the child of the joints `ab` and `ba`; a robot is a tree"
    );
    assert_eq!(
        error_of(&[a.clone(), b.clone(), ab("fixed"), joint_text("ba", "fixed", "b", "a", "")]),
        "every link is the child of a joint, so the links form a loop; a robot has one root"
    );
    let ring = [link_text("root"), a.clone(), b, ab("fixed"), joint_text("ba", "fixed", "b", "a", "")];
    assert_eq!(error_of(&ring), "the links a, b form a loop");
    let hollow = [a.clone(), "<link name=\"b\"/>".into(), ab("continuous")];
    assert_eq!(
        error_of(&hollow),
        "joint `ab` moves `b`, which has no mass and carries no link with mass; give it an <inertial>"
    );
    assert_eq!(error_of(&[a.replace("\"2\"", "\"-1\"")]), "mass of `a` is -1, which is not a valid mass");
    assert!(error_of(&["<link".into()]).starts_with("not a URDF: "));
}

#[test]
fn a_robot_survives_a_round_trip_through_urdf() {
    let shapes = r#"<collision><origin xyz="0 1 0" rpy="0.3 -0.2 0.1"/><geometry><box size="0.1 0.2 0.3"/></geometry>
        </collision><collision><geometry><sphere radius="0.1"/></geometry></collision>
        <collision><geometry><cylinder radius="0.1" length="0.5"/></geometry></collision>
        <collision><geometry><capsule radius="0.1" length="0.5"/></geometry></collision>"#;
    let inside = r#"<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/><dynamics damping="0.5" friction="0.25"/>
        <limit lower="-0.5" upper="2" effort="10" velocity="3"/>"#;
    let parts = [
        link_text("a &amp; co"),
        format!("<link name=\"b\">{BODY}{shapes}</link>"),
        link_text("c"),
        link_text("d"),
        joint_text("ab", "revolute", "a &amp; co", "b", inside),
        joint_text("bc", "prismatic", "b", "c", inside),
        joint_text("cd", "continuous", "c", "d", "<axis xyz=\"1 0 0\"/>"),
    ];
    let (robot, warnings) = parse_urdf(&robot_text(&parts), Base::Floating).unwrap();
    assert_eq!((robot.links[1].shapes.len(), warnings), (4, vec![]));
    let (again, warnings) = parse_urdf(&to_urdf(&robot), Base::Floating).unwrap();
    assert_eq!(warnings, vec![]);
    for (a, b) in robot.links.iter().zip(&again.links) {
        // Rotations pass through roll, pitch and yaw; everything else is the same to the bit.
        assert!(a.joint.origin.rotation.angle_to(&b.joint.origin.rotation) < 1e-15, "{}", a.name);
        let mut b = b.clone();
        b.joint.origin = a.joint.origin;
        for (shape, other) in a.shapes.iter().zip(&mut b.shapes) {
            assert!(shape.pose.rotation.angle_to(&other.pose.rotation) < 1e-15, "{}", a.name);
            other.pose = shape.pose;
        }
        assert_eq!(*a, b);
    }
}

#[test]
fn a_file_that_is_too_deep_or_too_long_is_refused() {
    let deep = |depth: usize| format!("<robot name=\"r\">{}{}</robot>", "<a>".repeat(depth), "</a>".repeat(depth));
    let told = |text: &str| parse_urdf(text, Base::Fixed).unwrap_err().to_string();
    let refusal = "more than 100 elements lie inside each other; a URDF needs no more than five";
    assert_eq!(told(&deep(20_000)), refusal);
    assert_eq!(told(&deep(DEEPEST_XML)), refusal);
    assert_eq!(told(&deep(DEEPEST_XML - 1)), "there is no <link> in the <robot>");
    // What lies in a comment lies nowhere, and what is closed at once is not open.
    let hidden = format!("<robot name=\"r\"><!--{}-->{}</robot>", "<a>".repeat(200), "<a b=\">\"/>".repeat(200));
    assert_eq!(told(&hidden), "there is no <link> in the <robot>");
    let links: Vec<String> = (0..=MOST_LINKS).map(|k| link_text(&format!("l{k}"))).collect();
    assert_eq!(error_of(&links), "501 links; at most 500 are simulated");
}

#[test]
fn what_is_no_number_is_refused_by_name() {
    let [a, b] = ["a", "b"].map(link_text);
    let ab = |inside: &str| error_of(&[a.clone(), b.clone(), joint_text("ab", "revolute", "a", "b", inside)]);
    let told = |what: &str, of: &str| format!("{what} of `{of}` is NaN, which is not a valid {what}");
    for (inside, what) in [
        ("<origin xyz=\"0 nan 0\"/>", "origin"),
        ("<origin xyz=\"0 0 0\" rpy=\"nan 0 0\"/>", "orientation"),
        ("<axis xyz=\"nan 0 0\"/>", "axis"),
        ("<limit lower=\"nan\" upper=\"1\" effort=\"1\" velocity=\"1\"/>", "lower limit"),
        ("<limit lower=\"-1\" upper=\"nan\" effort=\"1\" velocity=\"1\"/>", "upper limit"),
        ("<limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"nan\"/>", "velocity"),
        ("<dynamics damping=\"nan\" friction=\"0\"/>", "damping"),
        ("<mimic joint=\"ab\" multiplier=\"nan\"/>", "multiplier"),
    ] {
        assert_eq!(ab(inside), told(what, "ab"));
    }
    for (before, what) in
        [("<mass value=\"2", "mass"), ("xyz=\"0 0 0.1", "origin"), ("ixx=\"1", "ixx"), ("iyz=\"0", "iyz")]
    {
        let (start, _) = before.rsplit_once('"').unwrap();
        let with = if what == "origin" { format!("{start}\"0 0 nan") } else { format!("{start}\"nan") };
        assert_eq!(error_of(&[a.replace(before, &with)]), told(what, "a"));
    }
    let shape = "<collision><geometry><sphere radius=\"-1\"/></geometry></collision></link>";
    let told = error_of(&[a.replace("</link>", shape)]);
    assert_eq!(told, "radius of `a` is -1, which is not a valid radius");
}

#[test]
fn meshes_are_enclosed_by_boxes_that_are_drawn_and_touch_nothing() {
    let part = |kind: &str, file: &str, scale: &str, origin: &str| {
        format!("<{kind}>{origin}<geometry><mesh filename=\"{file}\" {scale}/></geometry></{kind}>")
    };
    let link = format!(
        "<link name=\"a\">{BODY}{}{}</link>",
        part("visual", "fine.dae", "", ""),
        part(
            "collision",
            "a.stl",
            "scale=\"0.001 -0.002 0.001\"",
            "<origin xyz=\"1 0 0\" rpy=\"0 0 1.5707963267948966\"/>"
        )
    );
    let drawn = format!("<link name=\"b\">{BODY}{}</link>", part("visual", "b.dae", "", ""));
    let text = robot_text(&[link, drawn, joint_text("ab", "continuous", "a", "b", "")]);
    let meshes = meshes(&text).unwrap();
    let named: Vec<_> = meshes.iter().map(|mesh| (mesh.link.as_str(), mesh.file.as_str())).collect();
    assert_eq!(named, [("a", "a.stl"), ("b", "b.dae")], "a collision's mesh goes before a picture's");
    let (mut robot, _) = parse_urdf(&text, Base::Fixed).unwrap();
    meshes[0].enclose(&mut robot, Point3::new(0.0, 0.0, -100.0), Point3::new(100.0, 300.0, 100.0));
    let [Shape { pose, geometry: Geometry::Box { half_m } }] = &robot.links[0].mesh_boxes[..] else { panic!("a box") };
    assert!((half_m - vector![0.05, 0.3, 0.1]).norm() < 1e-15, "{half_m}");
    // Mirrored in y, then turned by a right angle, then moved.
    assert!((pose.translation.vector - vector![1.0 + 0.3, 0.05, 0.0]).norm() < 1e-15, "{pose}");
    assert!(robot.links[0].shapes.is_empty());
    assert_eq!(to_urdf(&robot).matches("<box").count(), 1, "a picture, and no contact");
    assert!(parse_urdf(&to_urdf(&robot), Base::Fixed).unwrap().0.links[0].shapes.is_empty());
    let endless = text.replace("0.001 -0.002", "inf -0.002");
    assert_eq!(super::meshes(&endless).unwrap_err().to_string(), "scale of `a` is inf, which is not a valid scale");
}
