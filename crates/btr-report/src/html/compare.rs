//! The report of `btr compare`.

use super::joints::{ComparedLogs, LOGS_SHOWN, joints};
use super::page::{Block, Report, Section};
use super::player::{AS_IT_STANDS, Player, Replayed, ReplayedState};
use crate::plot::heat::{Heat, heat};
use crate::text::{CHANNEL_HEADER, FURTHER_LEGEND, LEGEND, about_the_step, channel_rows, left_out};
use btr_identify::compare::{JointTrack, Regime, RegimeCell};
use btr_lab::verbs::CompareReport;

/// Number of time windows of the map over time.
const WINDOWS: usize = 12;

/// The page of `btr compare`.
pub fn compare(outcome: &CompareReport) -> String {
    let mut sections = vec![summary(outcome), failures(outcome)];
    let names: Vec<&str> = outcome.names.iter().map(String::as_str).collect();
    let player = player(outcome, &names);
    let problem = ComparedLogs {
        names,
        logs: &outcome.replays.logs,
        before: None,
        between: Vec::new(),
        after: &outcome.comparison,
    };
    sections.extend(problem.sections());
    Report { title: format!("{}: where the model fails", outcome.model), sections, player }.html()
}

fn player(outcome: &CompareReport, names: &[&str]) -> Option<Player> {
    let state = ReplayedState {
        name: AS_IT_STANDS.to_owned(),
        error: None,
        comparison: &outcome.comparison,
        simulated: &outcome.simulated,
    };
    let (model, logs) = (&outcome.replays.model, &outcome.replays.logs);
    Player::of(&Replayed { model, names, logs, states: vec![state], errors_are: None, in_windows: false })
}

fn summary(outcome: &CompareReport) -> Section {
    let logs = outcome.names.join(", ");
    let model = &outcome.model;
    let lead = outcome.verdict().sentences.into_iter().map(Block::Lead);
    let mut blocks: Vec<Block> = lead.collect();
    blocks.extend([
        Block::Text(format!("{model}, simulated with the commands of the logs: {logs}.")),
        Block::Table {
            header: CHANNEL_HEADER.iter().map(|&cell| cell.to_owned()).collect(),
            rows: channel_rows(outcome),
        },
        Block::Text("Errors are measured minus simulated.".to_owned()),
        Block::List(LEGEND.iter().chain(&FURTHER_LEGEND).map(|&line| line.to_owned()).collect()),
    ]);
    blocks.extend(about_the_step(outcome).map(Block::Text));
    let left_out = outcome.replays.left_out.iter().map(left_out);
    let noticed: Vec<String> = left_out.chain(outcome.replays.warnings.iter().cloned()).collect();
    if !noticed.is_empty() {
        blocks.push(Block::List(noticed));
    }
    Section { title: "Channels".to_owned(), blocks }
}

fn failures(outcome: &CompareReport) -> Section {
    const OF_EACH_JOINT: usize = 3;
    let failures = outcome.most_telling(OF_EACH_JOINT);
    let line = |cell: &&RegimeCell| {
        let share = 100.0 * cell.share;
        let RegimeCell { hint, log, t0_s, t1_s, .. } = cell;
        format!("{hint}. {share:.0} % of the squared error, most of it in {log} from {t0_s:.2} to {t1_s:.2} s.")
    };
    let list = match failures.len() {
        0 => Block::Text("No joint fails in one regime of motion more than in others.".to_owned()),
        _ => Block::List(failures.iter().map(line).collect()),
    };
    let joints = joints(&outcome.comparison);
    let chi = |joint: &str, regime: Regime| {
        outcome.comparison.cells.iter().find(|c| c.joint == joint && c.regime == regime).map(|cell| cell.chi)
    };
    let rows = Regime::ALL.iter().filter(|regime| joints.iter().any(|joint| chi(joint, **regime).is_some()));
    let by_regime = Heat {
        title: "By regime".to_owned(),
        columns: joints.clone(),
        rows: rows.map(|r| (r.words().to_owned(), joints.iter().map(|joint| chi(joint, *r)).collect())).collect(),
    };
    let over_time = worst_logs(outcome).into_iter().take(LOGS_SHOWN).map(|log| heat(&by_time(outcome, log)));
    let maps = std::iter::once(heat(&by_regime)).chain(over_time).collect();
    let mut text =
        "Errors of the joints' positions in multiples of the noise floor, by regime of motion and over time."
            .to_owned();
    if outcome.names.len() > LOGS_SHOWN {
        text += &format!(" The {LOGS_SHOWN} logs with the largest errors are drawn, of {}.", outcome.names.len());
    }
    Section { title: "Where it fails".to_owned(), blocks: vec![list, Block::Text(text), Block::Maps(maps)] }
}

/// The logs, the one with the largest error first.
fn worst_logs(outcome: &CompareReport) -> Vec<usize> {
    let squares = |track: &JointTrack| -> f64 {
        track.error.iter().filter(|e| e.is_finite()).map(|e| (e / track.floor).powi(2)).sum()
    };
    let of_log = |log: usize| outcome.comparison.tracks.iter().filter(|t| t.log == log).map(squares).sum::<f64>();
    let mut logs: Vec<(usize, f64)> = (0..outcome.names.len()).map(|log| (log, of_log(log))).collect();
    logs.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    logs.into_iter().map(|(log, _)| log).collect()
}

/// The error of every joint in each twelfth of a log.
fn by_time(outcome: &CompareReport, log: usize) -> Heat {
    let tracks: Vec<&JointTrack> = outcome.comparison.tracks.iter().filter(|track| track.log == log).collect();
    let long_s = tracks.iter().filter_map(|track| track.clock_s.last().copied()).fold(0.0, f64::max);
    let width_s = long_s / WINDOWS as f64;
    let chi = |track: &JointTrack, window: usize| {
        let (from, to) = (window as f64 * width_s, (window + 1) as f64 * width_s);
        let within = track.clock_s.iter().zip(&track.error).filter(|(t, e)| **t >= from && **t < to && e.is_finite());
        let (n, squares) = within.fold((0.0, 0.0), |(n, sum), (_, e)| (n + 1.0, sum + (e / track.floor).powi(2)));
        (n > 0.0).then(|| f64::sqrt(squares / n))
    };
    let row = |window: usize| {
        let name = format!("{:.1} to {:.1} s", window as f64 * width_s, (window + 1) as f64 * width_s);
        (name, tracks.iter().map(|track| chi(track, window)).collect())
    };
    Heat {
        title: format!("Over {}", outcome.names[log]),
        columns: tracks.iter().map(|track| track.joint.clone()).collect(),
        rows: (0..WINDOWS).map(row).collect(),
    }
}
