//! Transfer by quality diversity: an archive of diverse controllers, of which a few are tried on a damaged or different
//! robot.
//!
//! The intelligent trial and error of A. Cully, J. Clune, D. Tarapore and J.-B. Mouret, "Robots that can adapt like
//! animals", Nature 521, 2015 (doi:10.1038/nature14422). Before any real test, MAP-Elites fills a map with the best
//! controller of each kind, as the nominal simulation has it. Then one controller is tried at a time. A Gaussian
//! process over the descriptors learns by how much reality differs from the map, so that one test is informative about
//! all controllers of a similar kind. The next test is that of the controller with the largest upper confidence bound.
//! The run ends once no controller's prediction is much better than the best real fitness.
//!
//! The transferability approach of S. Koos, J.-B. Mouret and S. Doncieux (IEEE Transactions on Evolutionary Computation
//! 17, 2013) has this in common with it: the simulation does not change, and a few real tests teach a regression over
//! descriptors of behaviours how far it can be believed. It differs in what is learnt and when. There, it is the size
//! of the disparity, a second objective beside fitness while controllers evolve, so that the search keeps to where the
//! simulation is right; tests are spread over what was not tried yet. Here, all of the search comes before the first
//! test. What is learnt is the difference in fitness with its sign, so that a controller may well be one which the
//! simulation misjudges; and tests go to where fitness is expected.
//!
//! Where btr differs from Cully and others: the variance of the Gaussian process is not a setting but comes from the
//! map's own spread, and from the tests as soon as there are some; so promises have intervals.

mod descriptor;
mod gaussian_process;
mod outlook;
mod phase;

pub(super) use descriptor::judged;
pub use outlook::{Outlook, Promise};
pub use phase::{MapError, MapPhase};
