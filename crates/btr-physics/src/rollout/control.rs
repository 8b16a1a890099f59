//! From the drive's references to what acts on every joint: commands, effects on them, motors, effects on those.

use crate::actuation::{JointInput, Motor, MotorTorque, TorqueBound};
use crate::drive::Drive;
use crate::effects::{Effect, PlacedEffect, SiteKind};
use crate::engine::carried_inertia;
use crate::engine::{Affine, Bounded, Dof, Dynamics, PrescribedMotion};
use crate::robot::{Joint, Link, Robot};
use crate::setup::Setup;
use btr_core::world::WorldError;

/// The controller's side of a run.
pub(crate) struct Control<'a> {
    reference: ReferenceTracker<'a>,
    joints: Vec<JointControl>,
    dt_s: f64,
    /// When the run begins, by the clock of laws.
    begins_s: f64,
    /// Whether any effect acts on all joints at once; only then the load is summed up.
    coupled: bool,
    /// Sum of the sizes of all motors' torques in the last step.
    load: f64,
    /// What prescribed motions need; empty where there are none.
    needed: Vec<f64>,
    /// Positions and velocities of the joints as the step begins.
    states: Vec<(f64, f64)>,
}

/// The drive's references around the present.
struct ReferenceTracker<'a> {
    drive: &'a dyn Drive,
    control_s: f64,
    /// Number of the last reference; `usize::MAX` before the first.
    tick: usize,
    last: Vec<f64>,
    next: Vec<f64>,
}

/// One joint: its motor, what acts on it always, and the effects on it.
struct JointControl {
    motor: Motor,
    passive: Dof,
    instances: Vec<EffectInstance>,
    /// Roughly what it moves, in kg·m² (kg).
    inertia: f64,
    /// Whether it is led from one reference to the next.
    led: bool,
    /// What it was told last, before any effect.
    command: f64,
    /// What arrives at the link of the motor's torque during the step, as far as the motor's bound lets it.
    acting: Affine,
    bound: TorqueBound,
    /// Whether the motor has a rotor of its own behind a transmission that is not rigid.
    rotor: bool,
    /// The motor's torque as the coming step begins, where that is known apart from the step: a digital servo has
    /// worked it out, a prescribed motion needs it.
    told: Option<f64>,
    /// Its velocity as the last step began.
    before: Option<f64>,
}

/// An effect on one joint with its memory.
struct EffectInstance {
    effect: &'static dyn Effect,
    values: Vec<f64>,
    memory: Vec<f64>,
    /// Position and velocity on its side towards the link.
    link_side: (f64, f64),
}

impl<'a> Control<'a> {
    /// Allocates everything that the run needs.
    pub(crate) fn new(
        robot: &Robot,
        effects: &[PlacedEffect],
        setup: &Setup,
        drive: &'a dyn Drive,
    ) -> Result<Self, WorldError> {
        let carried = carried_inertia(robot);
        let mut joints: Vec<JointControl> = robot
            .movable()
            .zip(carried)
            .map(|((_, link), inertia)| JointControl::new(&link.joint, inertia, setup))
            .collect();
        for placed in effects {
            for joint in placed.joints(robot)? {
                joints[joint].place(placed, setup.dt_s);
            }
        }
        let reference = ReferenceTracker::new(drive, setup.control_s, joints.len());
        let coupled = effects.iter().any(|placed| placed.effect.spec().site == SiteKind::Robot);
        let prescribed = joints.iter().any(|joint| joint.motor.is_prescribed());
        let needed = if prescribed { vec![f64::NAN; joints.len()] } else { Vec::new() };
        let (dt_s, begins_s) = (setup.dt_s, setup.begins_s);
        let states = Vec::with_capacity(joints.len());
        Ok(Control { reference, joints, dt_s, begins_s, coupled, load: 0.0, needed, states })
    }

    /// Takes in the references that are valid at `time_s`, the present.
    pub(crate) fn listen(&mut self, time_s: f64, engine: &dyn Dynamics) {
        self.reference.advance(time_s, engine);
        let share = self.reference.share(time_s);
        for (i, joint) in self.joints.iter_mut().enumerate() {
            joint.command = if joint.led { self.reference.led(i, share) } else { self.reference.last[i] };
        }
    }

    /// Sets what acts on the joints during the step that begins at `time_s`.
    pub(crate) fn act(&mut self, time_s: f64, engine: &mut dyn Dynamics) {
        self.states.clear();
        self.states.extend(engine.positions().iter().copied().zip(engine.velocities().iter().copied()));
        if self.coupled {
            let states = self.joints.iter().zip(&self.states);
            self.load = states.map(|(joint, &(q, dq))| joint.torque(q, dq).abs()).sum();
        }
        let (midway, leads, keeps_bounds) = (engine.midway(), engine.leads(), engine.keeps_bounds());
        let (in_the_middle, at_the_end) =
            (self.reference.share(time_s + 0.5 * self.dt_s), self.reference.share(time_s + self.dt_s));
        for (i, (joint, &(q, dq))) in self.joints.iter_mut().zip(&self.states).enumerate() {
            let course = if joint.motor.is_prescribed() { self.reference.course(i, time_s, self.dt_s) } else { None };
            // A prescribed joint shall be at its reference when the step ends.
            let command = match course {
                Some(course) => course.to.value,
                None if joint.motor.is_prescribed() => self.reference.led(i, at_the_end),
                // What a step solves for its middle is told what holds there; a digital servo reads at instants.
                None if joint.led && midway && !joint.motor.is_sampled() => self.reference.led(i, in_the_middle),
                None => joint.command,
            };
            let (inertia, dt_s, load) = (joint.inertia, self.dt_s, self.load);
            // Only effects ask for these.
            let before = joint.before.filter(|_| !joint.instances.is_empty());
            let acceleration = before.map_or(0.0, |before| (dq - before) / dt_s);
            let torque = if joint.instances.is_empty() { 0.0 } else { joint.torque(q, dq) };
            joint.before = Some(dq);
            let state = JointInput {
                time_s: self.begins_s + time_s,
                dt_s,
                q,
                dq,
                acceleration,
                midway,
                inertia,
                torque,
                load,
                command,
            };
            let dof = match course.filter(|_| leads) {
                Some(course) => joint.follow(course, &state),
                None => joint.act(&state, keeps_bounds),
            };
            engine.set_joint(i, &dof);
        }
        if !self.needed.is_empty() {
            self.ask_needed(engine);
        }
    }

    /// What prescribed motions need is what their motors are taken to do.
    fn ask_needed(&mut self, engine: &mut dyn Dynamics) {
        self.needed.fill(f64::NAN);
        engine.needed(&mut self.needed);
        for (joint, &torque) in self.joints.iter_mut().zip(&self.needed).filter(|(_, torque)| !torque.is_nan()) {
            (joint.acting, joint.bound) = (Affine::constant(torque), TorqueBound::NONE);
            joint.told = Some(torque);
        }
    }

    /// What an effect could not do.
    pub(crate) fn trouble(&self, robot: &Robot) -> Option<WorldError> {
        let of = |(joint, (_, link)): (&JointControl, (usize, &Link))| {
            let mut instances = joint.instances.iter();
            instances.find_map(|s| s.effect.trouble(&s.values, &s.memory, &link.joint.name))
        };
        self.joints.iter().zip(robot.movable()).find_map(of)
    }

    /// Whether any joint's motion is prescribed.
    pub(crate) fn follows(&self) -> bool {
        !self.needed.is_empty()
    }

    /// Whether any motor's torque is known at the beginning of a step.
    pub(crate) fn tells(&self) -> bool {
        self.joints.iter().any(|joint| joint.told.is_some())
    }

    /// The torque of joint `i`'s motor as the step begins that was prepared last, where it is known apart from the
    /// step.
    pub(crate) fn told(&self, i: usize) -> Option<f64> {
        self.joints[i].told
    }

    /// What joint `i` was told, before any effect; NaN when it is not driven.
    pub(crate) fn command(&self, i: usize) -> f64 {
        self.joints[i].command
    }

    /// The torque of joint `i`'s motor in the state that the last step led to.
    pub(crate) fn torque(&self, i: usize, q: f64, dq: f64) -> f64 {
        self.joints[i].torque(q, dq)
    }
}

impl<'a> ReferenceTracker<'a> {
    fn new(drive: &'a dyn Drive, control_s: f64, joints: usize) -> Self {
        let undriven = vec![f64::NAN; joints];
        ReferenceTracker { drive, control_s, tick: usize::MAX, last: undriven.clone(), next: undriven }
    }

    /// Asks the drive when another reference is due.
    fn advance(&mut self, time_s: f64, engine: &dyn Dynamics) {
        // The share of a tick absorbs rounding: a step's time is a multiple of dt, a reference's one of control_s.
        let tick = (time_s / self.control_s + 1e-6).floor() as usize;
        if tick == self.tick {
            return;
        }
        if self.tick.checked_add(1) == Some(tick) {
            std::mem::swap(&mut self.last, &mut self.next);
        } else {
            self.ask(tick, engine);
            std::mem::swap(&mut self.last, &mut self.next);
        }
        self.ask(tick + 1, engine);
        self.tick = tick;
    }

    /// What is told from this tick to the one after it, into `next`.
    fn ask(&mut self, tick: usize, engine: &dyn Dynamics) {
        let (start_s, end_s) = (tick as f64 * self.control_s, (tick + 1) as f64 * self.control_s);
        self.drive.over(start_s, end_s, &mut self.next);
        if self.drive.senses() {
            self.drive.react(start_s, engine, &mut self.next);
        }
    }

    /// The prescribed motion of joint `i` in the step that begins at `time_s`.
    fn course(&self, i: usize, time_s: f64, dt_s: f64) -> Option<PrescribedMotion> {
        let (from, to) = (self.drive.motion(i, time_s)?, self.drive.motion(i, time_s + dt_s)?);
        Some(PrescribedMotion { from, to })
    }

    /// How much of the way from the last reference to the next one is gone.
    fn share(&self, time_s: f64) -> f64 {
        // Before time zero it rests at the first one.
        (time_s / self.control_s - self.tick as f64).max(0.0)
    }

    /// The reference of joint `i` on the line from the last to the next one.
    fn led(&self, i: usize, share: f64) -> f64 {
        self.last[i] + share * (self.next[i] - self.last[i])
    }
}

impl JointControl {
    fn new(joint: &Joint, inertia: f64, setup: &Setup) -> Self {
        let motor = Motor::new(joint, inertia, setup.dt_s);
        let led = setup.interpolate || motor.is_prescribed();
        let torque = Affine { damping: joint.damping, ..Affine::default() };
        let (dry_friction, armature) = (joint.dry_friction, joint.armature);
        let passive = Dof { torque, dry_friction, armature, ..Dof::default() };
        JointControl {
            motor,
            passive,
            instances: Vec::new(),
            inertia,
            led,
            command: f64::NAN,
            acting: Affine::default(),
            bound: TorqueBound::NONE,
            rotor: false,
            told: None,
            before: None,
        }
    }

    fn place(&mut self, placed: &PlacedEffect, dt_s: f64) {
        placed.effect.joint(&placed.values, &mut self.passive);
        let memory = vec![0.0; placed.effect.memory(&placed.values, dt_s)];
        let (effect, values) = (placed.effect, placed.values.clone());
        self.rotor |= effect.motor_side(&memory, 0.0).is_some();
        self.instances.push(EffectInstance { effect, values, memory, link_side: (0.0, 0.0) });
    }

    /// The motor's torque where the last step led to: its law there, within its bound.
    fn torque(&self, q: f64, dq: f64) -> f64 {
        let (torque, dq) = self.motor_side(q, dq);
        self.bound.clamp(torque, dq)
    }

    /// The motor's torque without its bound, and its velocity, on its own side of the transmission.
    fn motor_side(&self, q: f64, dq: f64) -> (f64, f64) {
        let mut side = (self.acting.at(q, dq), dq);
        for instance in &self.instances {
            side = instance.effect.motor_side(&instance.memory, side.1).unwrap_or(side);
        }
        side
    }

    fn act(&mut self, state: &JointInput, keeps_bounds: bool) -> Dof {
        if self.instances.is_empty() {
            return self.drive(state, keeps_bounds);
        }
        // What the servo sees: its own side of the transmission, and the command that reaches it.
        let mut servo = *state;
        for instance in &mut self.instances {
            instance.link_side = (servo.q, servo.dq);
            (servo.q, servo.dq) = instance.effect.encoder(&instance.values, &mut instance.memory, &servo);
        }
        for instance in &mut self.instances {
            servo.command = instance.effect.command(&instance.values, &mut instance.memory, &servo);
        }
        let mut motor = self.motor.torque(&servo);
        for instance in &mut self.instances {
            instance.effect.motor(&instance.values, &mut instance.memory, &mut motor, &servo);
        }
        let mut dof = self.passive;
        self.bound = motor.bound;
        self.told = self.motor.is_sampled().then(|| motor.at(servo.q, servo.dq));
        let keeps_bounds = keeps_bounds && !self.rotor;
        if self.rotor {
            self.turn_rotor(&motor, &mut dof, [state, &servo]);
        } else {
            let law = if keeps_bounds { motor.wanted } else { motor.saturated(&servo) };
            self.transmit(law, &mut dof, state);
        }
        for instance in &mut self.instances {
            instance.effect.torque(&instance.values, &mut instance.memory, &mut dof, state);
        }
        // What encoders tell the servo changes nothing about the speed that bounds its motor.
        self.push(&mut dof, motor.bounded(state).filter(|_| keeps_bounds));
        dof
    }

    /// What arrives at the link of this law of the motor.
    fn transmit(&mut self, law: Affine, dof: &mut Dof, state: &JointInput) {
        self.acting = law;
        for instance in self.instances.iter_mut().rev() {
            let (q, dq) = instance.link_side;
            let (values, memory) = (&instance.values, &mut instance.memory);
            self.acting = instance.effect.transmit(values, memory, self.acting, dof, &JointInput { q, dq, ..*state });
        }
    }

    /// A motor with a rotor of its own is solved here, beside the link as it moves: where it would exceed its bound
    /// there, it is solved again at its bound. The second state is the servo's.
    fn turn_rotor(&mut self, motor: &MotorTorque, dof: &mut Dof, [state, servo]: [&JointInput; 2]) {
        let before = *dof;
        self.transmit(motor.wanted, dof, state);
        let (torque, dq) = self.motor_side(state.q, state.dq);
        if let Some(law) = motor.beyond(torque, dq, servo) {
            *dof = before;
            self.transmit(law, dof, state);
        }
    }

    /// The motor and nothing else.
    fn drive(&mut self, state: &JointInput, keeps_bounds: bool) -> Dof {
        let motor = self.motor.torque(state);
        self.acting = if keeps_bounds { motor.wanted } else { motor.saturated(state) };
        self.bound = motor.bound;
        self.told = self.motor.is_sampled().then(|| motor.at(state.q, state.dq));
        let mut dof = self.passive;
        self.push(&mut dof, motor.bounded(state).filter(|_| keeps_bounds));
        dof
    }

    /// Lets the motor push, within `bounded` if the engine shall see to that.
    fn push(&self, dof: &mut Dof, bounded: Option<Bounded>) {
        dof.motor = bounded.map(|bounded| Bounded { wanted: self.acting, ..bounded });
        if dof.motor.is_none() {
            dof.torque.add(&self.acting);
        }
    }

    /// What acts on a joint that is on a course, but for what keeps it there: no motor, no transmission.
    fn follow(&mut self, course: PrescribedMotion, state: &JointInput) -> Dof {
        let mut dof = Dof { course: Some(course), ..self.passive };
        for instance in &mut self.instances {
            instance.effect.torque(&instance.values, &mut instance.memory, &mut dof, state);
        }
        dof
    }
}
