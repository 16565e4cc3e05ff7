"""Studies and scenes as documents: models, presets, and changes by dotted path."""
