//! Physical effects that a model may lack. Each effect is a named group of parameters with *off* values, defined in its
//! own file.

mod commanded;
mod coupling;
mod effect;
mod formula;
mod readings;
mod rotor;

pub use commanded::commanded;
pub use effect::{DryFriction, Effect, EffectSpec, MissingNeighbour, Param, PlacedEffect, SiteKind, TorqueLaw};
pub use formula::error::FormulaError;
pub use formula::law::{LawFunction, LawInputs, Laws};
pub use formula::{FORMULA, FormulaTarget, formula, formula_or_function};
pub use rotor::UNKNOWN_ROTOR;

use btr_core::world::WorldError;

/// Declares the effects' modules by folder, and lists the effects in [`EFFECTS`].
macro_rules! effects {
    ($($folder:ident { $($file:ident::$effect:ident),* $(,)? })*) => {
        $(mod $folder {
            $(pub(super) mod $file;)*
        })*
        /// All effects, in the order in which they act.
        pub static EFFECTS: &[&dyn Effect] = &[$($(&$folder::$file::$effect),*),*];
    };
}

// Effects act in this order, whatever their order in a model file: commands from the sender to the servo,
// transmissions from the link to the motor, encoders from the shaft to the reading.
effects! {
    friction {
        coulomb_friction::CoulombFriction,
        viscous_friction::ViscousFriction,
        stribeck_friction::StribeckFriction,
        asymmetric_friction::AsymmetricFriction,
        presliding_friction::PreslidingFriction,
        load_dependent_friction::LoadDependentFriction,
        friction_creep::FrictionCreep,
        quadratic_drag::QuadraticDrag,
    }
    joint {
        armature::Armature,
        parallel_spring::ParallelSpring,
        cogging::Cogging,
        parent_coupling::PARENT_COUPLING,
        child_coupling::CHILD_COUPLING,
    }
    motor {
        torque_limit::TorqueLimit,
        speed_torque_limit::SpeedTorqueLimit,
        voltage_sag::VoltageSag,
        thermal_fade::ThermalFade,
    }
    command {
        command_delay::CommandDelay,
        command_resolution::CommandResolution,
        command_hysteresis::CommandHysteresis,
        motor_lag::MotorLag,
        command_rate_limit::CommandRateLimit,
        command_deadband::CommandDeadband,
        command_offset::CommandOffset,
        command_scale::CommandScale,
    }
    body {
        payload::Payload,
        end_payload::EndPayload,
        tool_load::ToolLoad,
        com_offset::ComOffset,
        link_inertia::LinkInertia,
        gravity_tilt::GravityTilt,
    }
    transmission {
        backlash::Backlash,
        joint_elasticity::JointElasticity,
    }
    sensor {
        encoder_scale::EncoderScale,
        encoder_offset::EncoderOffset,
        encoder_delay::EncoderDelay,
        encoder_lead::EncoderLead,
        torque_scale::TorqueScale,
        imu_bias::ImuBias,
        clock_skew::ClockSkew,
    }
    ground {
        ground_friction::GroundFriction,
        contact_compliance::ContactCompliance,
    }
}

/// The effect of that name.
pub fn find(name: &str) -> Option<&'static dyn Effect> {
    EFFECTS.iter().copied().find(|effect| effect.spec().name == name)
}

/// The effects that are not off, in the order in which they act.
///
/// # Errors
/// [`WorldError::Setup`] for invalid values.
pub(crate) fn in_force(effects: &[PlacedEffect]) -> Result<Vec<PlacedEffect>, WorldError> {
    effects.iter().try_for_each(PlacedEffect::check)?;
    let mut acting: Vec<PlacedEffect> = effects.iter().filter(|placed| !placed.is_off()).cloned().collect();
    acting.sort_by_key(rank);
    Ok(acting)
}

/// Index in the order in which effects act.
pub fn rank(placed: &PlacedEffect) -> usize {
    let name = placed.effect.spec().name;
    EFFECTS.iter().position(|effect| effect.spec().name == name).unwrap_or(EFFECTS.len())
}
