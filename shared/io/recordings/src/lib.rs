//! Run folders and MCAP recordings.
