"""One local web page for a model and its logs: where the model fails, what it lacks, and the model that has it."""
