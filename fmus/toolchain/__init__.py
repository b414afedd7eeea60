"""From a model's equations to an FMU: kernel, exporters and compiler."""
