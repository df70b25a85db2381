//! Reading scenes from files.
