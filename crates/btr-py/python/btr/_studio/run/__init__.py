"""The page of a run of the Back-to-Reality loop, which reads the run's folder as it grows and never writes there."""
