//! The ant's drive: r_i = theta_i + a_i·sin(omega·t + psi_i).

use super::Drive;

/// One sine per joint around a centre.
#[derive(Clone, Debug, PartialEq)]
pub struct Sine {
    /// theta_i, in rad.
    pub centres: Vec<f64>,
    /// The paper's controller c = [a_1, psi_1, a_2, psi_2, ...], in rad.
    pub controller: Vec<f64>,
    /// omega, in rad/s.
    pub omega_rad_s: f64,
}

impl Drive for Sine {
    fn command(&self, time_s: f64, command: &mut [f64]) {
        let waves = self.controller.chunks_exact(2);
        for ((command, centre), wave) in command.iter_mut().zip(&self.centres).zip(waves) {
            *command = centre + wave[0] * (self.omega_rad_s * time_s + wave[1]).sin();
        }
    }
}
