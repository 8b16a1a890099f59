//! Reports for people: `--report` of `compare`, `diagnose` and `fit`. That browsers draw them is asked in tests/python.

use crate::compare::{FRICTION, NONE, lab};
use crate::lab::Lab;

/// The page has all of this, is whole, and asks nobody for anything.
fn shows(html: &str, all: &[&str]) {
    all.iter().for_each(|text| assert!(html.contains(&format!(">{text}")), "no {text}"));
    assert!(html.contains("default-src 'none'") && html.contains("prefers-color-scheme"));
    assert!(!html.contains("NaN") && !html.contains("src=") && !html.contains("<script"));
    closes_what_it_opens(html);
}

/// Every tag is closed in its order.
fn closes_what_it_opens(html: &str) {
    let mut open: Vec<&str> = Vec::new();
    for tag in html.split('<').skip(1).filter(|tag| !tag.starts_with('!')) {
        let inside = tag.split('>').next().unwrap();
        let name = inside.trim_start_matches('/').split([' ', '/', '\n']).next().unwrap();
        match () {
            () if inside.starts_with('/') => assert_eq!(open.pop(), Some(name), "{tag}"),
            () if inside.ends_with('/') => {}
            () => open.push(name),
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn compare_draws_every_plot() {
    let lab = lab(FRICTION);
    lab.ok("compare swing.toml log.csv --report report.html -q");
    shows(
        &lab.read("report.html"),
        &[
            "hinge in log",
            "Residual in log",
            "Residual against velocity",
            "Residual against position",
            "Residual against load",
            "Residual around reversals",
            "Spectrum of the residual",
            "Autocorrelation of the residual",
            "By regime",
            "Over log",
        ],
    );
}

/// What `btr` writes into a report on the swing and its log, with these further arguments.
fn report(lab: &Lab, verb: &str, further: &str) -> String {
    lab.ok(&format!("{verb} swing.toml log.csv --report report.html -q {further}"));
    lab.read("report.html")
}

#[test]
fn diagnose_says_what_is_missing_and_shows_why() {
    let lab = lab(FRICTION);
    let html = report(&lab, "diagnose", "");
    shows(
        &html,
        &[
            "The model lacks coulomb_friction on hinge: with it, the error on the held-out logs falls from",
            "coulomb_friction.torque@hinge<",
            "Law: -torque",
            "The error, step by step<",
            "model as it stands<",
            "Round 1: the error with each candidate<",
            "coulomb_friction@hinge<",
            "before<",
            "after<",
            "after: hinge, throughout: 1.",
            "Residual against velocity<",
            "btr fit swing.toml log.csv --add coulomb_friction@hinge -o fitted.toml<",
            "q_hinge<",
        ],
    );
    // Wall time is nowhere in it.
    assert_eq!(html, report(&lab, "diagnose", "--threads 1"));
    // The next fit does not write over the model that it reads.
    lab.write("fitted.toml", &lab.read("swing.toml"));
    let next = lab.ok("diagnose fitted.toml log.csv -q");
    assert!(next.contains("--add coulomb_friction@hinge -o fitted_again.toml"), "{next}");
}

#[test]
fn diagnose_says_that_nothing_is_missing() {
    let html = report(&lab(NONE), "diagnose", "");
    shows(&html, &["Nothing is missing: the error on the held-out logs is", "No effect was fitted"]);
}

#[test]
fn fit_shows_each_value_between_its_bounds_or_why_there_is_no_interval() {
    let found = report(&lab(FRICTION), "fit", "--add coulomb_friction@hinge");
    let plots = [
        "The error, step by step<",
        "Each value between its bounds<",
        "coulomb_friction.torque@hinge<",
        "upper bound<",
    ];
    shows(&found, &plots);
    assert!(found.contains("what remains is noise") && !found.contains("withheld"), "{found}");
    let wrong = report(&lab(FRICTION), "fit", "--add parallel_spring@hinge");
    shows(&wrong, &["No intervals: the error is still"]);
    assert!(wrong.contains("(withheld)") || wrong.contains("(at its bound)"), "{wrong}");
}

#[test]
fn a_run_ends_with_where_its_files_are_and_a_fitted_model_says_what_holds_in_it() {
    let lab = lab(FRICTION);
    assert!(lab.ok("compare swing.toml log.csv --report where.html").ends_with("\nwhere.html: the report\n"));
    let fit = "fit swing.toml log.csv --add coulomb_friction@hinge";
    assert!(lab.ok(fit).ends_with("not saved: give -o FILE\n"));
    lab.write("swing.toml", &format!("#:schema no.schema.json\n{}", lab.read("swing.toml")));
    let told = lab.ok(&format!("{fit} -o fitted.toml --report fit.html"));
    assert!(told.ends_with("\nfitted.toml: the fitted model\n\nfit.html: the report\n"), "{told}");
    let fitted = lab.read("fitted.toml");
    let wins = "# As fitted: these values win over those under [robot] and [actuators].\n[parameters]\n";
    assert!(fitted.starts_with("name = \"swing\"\n") && fitted.contains(wins), "{fitted}");
    lab.ok("fit fitted.toml log.csv -o again.toml");
    assert_eq!(lab.read("again.toml").matches("As fitted").count(), 1);
}

#[test]
fn a_report_that_cannot_be_written_is_an_error() {
    let lab = lab(NONE);
    assert!(
        lab.complaint("fit swing.toml log.csv --add coulomb_friction@hinge --report no/such/folder.html")
            .contains("folder.html")
    );
}
