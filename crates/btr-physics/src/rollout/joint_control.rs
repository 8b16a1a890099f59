//! One joint in the control path of a rollout: its motor, and the effects on it.

use crate::actuation::{JointInput, Motor, MotorTorque, TorqueBound};
use crate::effects::{Effect, PlacedEffect};
use crate::engine::{Affine, Bounded, Dof, PrescribedMotion, carried_inertia};
use crate::robot::{Joint, Robot};
use crate::setup::Setup;
use btr_core::world::WorldError;

/// One joint: its motor, its passive forces, and the effects on it.
pub(super) struct JointControl {
    pub(super) motor: Motor,
    pub(super) passive: Dof,
    pub(super) instances: Vec<EffectInstance>,
    /// Estimate of the inertia that it moves, in kg·m² (kg).
    pub(super) inertia: f64,
    /// Whether its references are interpolated.
    pub(super) interpolated: bool,
    /// The last command, before any effect.
    pub(super) command: f64,
    /// The motor's torque as it reaches the link during the step, without the motor's bound.
    pub(super) transmitted: Affine,
    pub(super) bound: TorqueBound,
    /// Whether the motor has a rotor of its own behind an elastic or loose transmission.
    pub(super) rotor: bool,
    /// The motor's torque at the beginning of the coming step, where it is known independently of the step: computed by
    /// a digital servo, or required by a prescribed motion.
    pub(super) known_torque: Option<f64>,
    /// Its velocity at the beginning of the last step.
    pub(super) before: Option<f64>,
}

/// An effect on one joint with its internal state.
pub(super) struct EffectInstance {
    pub(super) effect: &'static dyn Effect,
    pub(super) values: Vec<f64>,
    pub(super) memory: Vec<f64>,
    /// Position and velocity on its link side.
    pub(super) link_side: (f64, f64),
}

/// The movable joints of a robot, each with the effects on it.
///
/// # Errors
/// An effect whose site matches nothing.
pub(super) fn joint_controls(
    robot: &Robot,
    effects: &[PlacedEffect],
    setup: &Setup,
) -> Result<Vec<JointControl>, WorldError> {
    let joints = robot.movable().zip(carried_inertia(robot));
    let mut joints: Vec<JointControl> =
        joints.map(|((_, link), inertia)| JointControl::new(&link.joint, inertia, setup)).collect();
    for placed in effects {
        for joint in placed.joints(robot)? {
            joints[joint].place(placed, setup.dt_s);
        }
    }
    Ok(joints)
}

impl JointControl {
    fn new(joint: &Joint, inertia: f64, setup: &Setup) -> Self {
        let motor = Motor::new(joint, inertia, setup.dt_s);
        let interpolated = setup.interpolate || motor.is_prescribed();
        JointControl {
            motor,
            passive: Dof::passive(joint),
            instances: Vec::new(),
            inertia,
            interpolated,
            command: f64::NAN,
            transmitted: Affine::default(),
            bound: TorqueBound::NONE,
            rotor: false,
            known_torque: None,
            before: None,
        }
    }

    /// Whether anything but its motor acts in it.
    pub(super) fn acts(&self) -> bool {
        !self.instances.is_empty() || self.passive != Dof::default()
    }

    fn place(&mut self, placed: &PlacedEffect, dt_s: f64) {
        placed.effect.joint(&placed.values, &mut self.passive);
        if placed.effect.is_constant() {
            return;
        }
        let memory = vec![0.0; placed.effect.memory(&placed.values, dt_s)];
        let (effect, values) = (placed.effect, placed.values.clone());
        self.rotor |= effect.motor_side(&memory, 0.0).is_some();
        self.instances.push(EffectInstance { effect, values, memory, link_side: (0.0, 0.0) });
    }

    /// The motor's torque at the end of the last step, within its bound.
    pub(super) fn torque(&self, q: f64, dq: f64) -> f64 {
        let (torque, dq) = self.motor_side(q, dq);
        self.bound.clamp(torque, dq)
    }

    /// The motor's torque without its bound, and its velocity, both on the motor side of the transmission.
    fn motor_side(&self, q: f64, dq: f64) -> (f64, f64) {
        let mut side = (self.transmitted.at(q, dq), dq);
        for instance in &self.instances {
            side = instance.effect.motor_side(&instance.memory, side.1).unwrap_or(side);
        }
        side
    }

    pub(super) fn act(&mut self, state: &JointInput, enforces_bounds: bool) -> Dof {
        if self.instances.is_empty() {
            return self.drive(state, enforces_bounds);
        }
        // Inputs of the servo: the state on its side of the transmission, and the command after the effects on it.
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
        self.known_torque = self.motor.is_sampled().then(|| motor.at(servo.q, servo.dq));
        let enforces_bounds = enforces_bounds && !self.rotor;
        if self.rotor {
            self.solve_rotor(&motor, &mut dof, [state, &servo]);
        } else {
            let law = if enforces_bounds { motor.requested } else { motor.saturated(&servo) };
            self.transmit(law, &mut dof, state);
        }
        for instance in &mut self.instances {
            instance.effect.torque(&instance.values, &mut instance.memory, &mut dof, state);
        }
        // Encoder errors do not affect the speed that bounds the motor.
        self.add_motor(&mut dof, motor.bounded(state).filter(|_| enforces_bounds));
        dof
    }

    /// Transmits a motor law through the transmissions to the link.
    fn transmit(&mut self, law: Affine, dof: &mut Dof, state: &JointInput) {
        self.transmitted = law;
        for instance in self.instances.iter_mut().rev() {
            let (q, dq) = instance.link_side;
            let (values, memory) = (&instance.values, &mut instance.memory);
            self.transmitted =
                instance.effect.transmit(values, memory, self.transmitted, dof, &JointInput { q, dq, ..*state });
        }
    }

    /// Solves a motor with a rotor of its own, outside the engine and at the link's present motion: where it would
    /// exceed its bound, it is solved again at its bound. The second state is the servo's.
    fn solve_rotor(&mut self, motor: &MotorTorque, dof: &mut Dof, [state, servo]: [&JointInput; 2]) {
        let before = *dof;
        self.transmit(motor.requested, dof, state);
        let (torque, dq) = self.motor_side(state.q, state.dq);
        if let Some(law) = motor.exceeded_bound(torque, dq, servo) {
            *dof = before;
            self.transmit(law, dof, state);
        }
    }

    /// Forces of a joint without effects.
    fn drive(&mut self, state: &JointInput, enforces_bounds: bool) -> Dof {
        let motor = self.motor.torque(state);
        self.transmitted = if enforces_bounds { motor.requested } else { motor.saturated(state) };
        self.bound = motor.bound;
        self.known_torque = self.motor.is_sampled().then(|| motor.at(state.q, state.dq));
        let mut dof = self.passive;
        self.add_motor(&mut dof, motor.bounded(state).filter(|_| enforces_bounds));
        dof
    }

    /// Adds the motor's torque; `bounded` if the engine is to enforce its bounds.
    fn add_motor(&self, dof: &mut Dof, bounded: Option<Bounded>) {
        dof.motor = bounded.map(|bounded| Bounded { requested: self.transmitted, ..bounded });
        if dof.motor.is_none() {
            dof.torque.add(&self.transmitted);
        }
    }

    /// Forces on a joint with a prescribed motion, other than the required torque: no motor, no transmission.
    pub(super) fn follow_prescribed(&mut self, prescribed: PrescribedMotion, state: &JointInput) -> Dof {
        let mut dof = Dof { prescribed: Some(prescribed), ..self.passive };
        for instance in &mut self.instances {
            instance.effect.torque(&instance.values, &mut instance.memory, &mut dof, state);
        }
        dof
    }
}
