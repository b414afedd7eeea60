"""Parts that converters share, whatever controls them: filter and transformer, current control, references."""
