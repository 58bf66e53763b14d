//! Configuration in TOML: declared once, checked, explained.
