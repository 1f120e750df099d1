"""One file a target: what is generated for it, and how that is loaded or packed."""
