//! Messages between processes: what a worker is sent, and what it answers.

use super::PENDULUM;
use crate::{SEPARATOR, files};
use btr_core::distance::{DistanceSpec, Rmse};
use btr_core::world::{Compared, Job, OutputRequest, Reference, Simulator};
use btr_identify::residual_model::{ResidualModel, ResidualRequest, TimeStep};
use btr_lab::distributed::{DistributedError, RemoteModel, RemoteSimulator, RunPayloads, TestComparison, serve};
use btr_lab::execution::{Cause, ExecutionContext, Executor, Payload};
use btr_lab::experiment::{LogSource, RealitySource, Source, model};
use btr_lab::verbs::VerbInput;
use btr_physics::model::Model;
use std::error::Error;
use std::path::PathBuf;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

type Told<T> = Result<T, Box<dyn Error + Send + Sync>>;

/// Work that is given to workers: rollouts of a problem, candidates of a population.
#[derive(Clone, Copy, Debug)]
enum Work {
    Rollouts,
    Population,
}

const WORKS: [Work; 2] = [Work::Rollouts, Work::Population];

/// What the work is about.
struct Setting {
    source: Source,
    model: Model,
    input: VerbInput,
    /// The messages of each work where nothing is damaged.
    honest: Vec<Messages>,
}

struct Messages {
    payloads: Vec<Vec<u8>>,
    batch: Vec<u8>,
    answer: Vec<u8>,
}

static SETTING: LazyLock<Told<Setting>> = LazyLock::new(|| {
    let source = Source::new("pendulum.toml", PENDULUM);
    let model = model(&source)?;
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let log = model.simulate(model.request(&s, 0).controller(&c).noise_seed(1))?;
    let input = VerbInput::new(source.clone(), &[LogSource::InMemory { name: PathBuf::from("log"), log }], &[])?;
    let mut setting = Setting { source, model, input, honest: Vec::new() };
    setting.honest = WORKS.into_iter().map(|work| setting.messages(work)).collect::<Told<_>>()?;
    Ok(setting)
});

/// Notes what it is asked, and answers this instead of working.
#[derive(Clone, Default)]
struct Recorder {
    asked: Arc<Mutex<Vec<Vec<u8>>>>,
    answer: Vec<u8>,
}

impl Executor for Recorder {
    fn workers(&self) -> usize {
        1
    }

    fn work(&self, payloads: &[Arc<Payload>], batch: &[u8]) -> Result<Vec<u8>, Cause> {
        let payloads = payloads.iter().map(|payload| payload.bytes.clone());
        let messages = std::iter::once(batch.to_vec()).chain(payloads).collect();
        *self.asked.lock().unwrap_or_else(PoisonError::into_inner) = messages;
        Ok(self.answer.clone())
    }
}

impl Setting {
    fn messages(&self, work: Work) -> Told<Messages> {
        let recorder = Recorder::default();
        self.ask(work, recorder.clone())?;
        let mut asked = std::mem::take(&mut *recorder.asked.lock().unwrap_or_else(PoisonError::into_inner)).into_iter();
        let batch = asked.next().ok_or("no worker was asked")?;
        let payloads: Vec<Vec<u8>> = asked.collect();
        let answer = served(&payloads.iter().map(Vec::as_slice).collect::<Vec<_>>(), &batch)?;
        Ok(Messages { payloads, batch, answer })
    }

    /// Has work done at the model's own values; whether there was an answer that could be used.
    fn ask(&self, work: Work, executor: Recorder) -> Told<bool> {
        let context = Arc::new(ExecutionContext::with_executor(Box::new(executor)));
        match work {
            Work::Rollouts => {
                let remote = RemoteModel::new(&self.input, context.clone())?;
                let origin = vec![0.0; self.input.problem.parameters().len()];
                let request = ResidualRequest::of(&origin, 0);
                remote.residuals(&[request, request], TimeStep::USUAL);
            }
            Work::Population => self.population(&context)?,
        }
        Ok(context.take_cause().inspect(|cause| drop(cause.to_string())).is_none())
    }

    fn population(&self, context: &ExecutionContext) -> Told<()> {
        let distance = DistanceSpec::Rmse(Rmse::default());
        let comparison = TestComparison { distance: &distance, reality: RealitySource::File };
        let payloads = RunPayloads::default();
        let remote = RemoteSimulator::new(&self.model, &self.source, comparison, context, &payloads)?;
        let (s, c) = (self.model.simulations().nominal(), self.model.controllers().nominal());
        let real = self.model.run(&s, &c, 0)?;
        let compare = |_: &_, _: &_| Compared { distance: 0.0, residuals: None };
        let against = Reference { test: 0, real: &real, squares: false, compare: &compare };
        let requests = [OutputRequest::Behaviour, OutputRequest::Fitness, OutputRequest::Distance(against)];
        let job = Job { s: &s, c: &c, scenario: 0 };
        remote.evaluate_all(&[job, job, job], &requests);
        Ok(())
    }
}

fn served(payloads: &[&[u8]], batch: &[u8]) -> Result<Vec<u8>, DistributedError> {
    let no_functions = |_: &[u8]| Err(DistributedError::Functions("no functions here".to_owned()));
    let keyed: Vec<(u64, &[u8])> = payloads.iter().map(|bytes| (u64::from(crc32fast::hash(bytes)), *bytes)).collect();
    serve(&keyed, batch, &no_functions, &ExecutionContext::default())
}

/// A batch, the payload of its problem or experiment, and that of a real test.
pub fn worker(data: &[u8]) -> bool {
    let [batch, payload, test] = files(data);
    let payloads = if test.is_empty() { &[payload][..] } else { &[payload, test] };
    let served = served(payloads, batch);
    served.inspect_err(|error| drop((error.to_string(), error.help().map(|help| help.to_string())))).is_ok()
}

/// The results in an answer, after which work it is of (the first byte); its fingerprint and its batch are right.
pub fn answer(data: &[u8]) -> bool {
    let (Ok(setting), Some((work, results))) = (SETTING.as_ref(), data.split_first()) else { return false };
    let work = WORKS[usize::from(*work) % WORKS.len()];
    let honest = &setting.honest[work as usize].answer;
    let answer = [&honest[..head_of(honest)], results].concat();
    setting.ask(work, Recorder { answer, ..Recorder::default() }).unwrap_or(false)
}

/// Length of the two numbers at an answer's beginning: the last byte of each has no upper bit.
fn head_of(answer: &[u8]) -> usize {
    let ends = answer.iter().enumerate().filter(|(_, byte)| **byte < 128);
    ends.map(|(k, _)| k + 1).nth(1).unwrap_or(0)
}

/// Honest batches with their payloads.
pub(crate) fn worker_seeds() -> Vec<Vec<u8>> {
    let files =
        |honest: &Messages| [std::slice::from_ref(&honest.batch), &honest.payloads[..]].concat().join(SEPARATOR);
    SETTING.as_ref().map(|setting| setting.honest.iter().map(files).collect()).unwrap_or_default()
}

/// The results of the honest answers.
pub(crate) fn answer_seeds() -> Vec<Vec<u8>> {
    let results = |(work, honest): (u8, &Messages)| [&[work], &honest.answer[head_of(&honest.answer)..]].concat();
    SETTING.as_ref().map(|setting| (0..).zip(&setting.honest).map(results).collect()).unwrap_or_default()
}
