//! How often light is reflected.

use std::{fmt, str::FromStr};

/// The most bounces that can be counted: without end is [`Bounces::All`], which weighs what it leaves out.
pub const MAX_BOUNCES: u32 = 1000;

/// How many surfaces indirect light may touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bounces {
    /// At most so many; 0 leaves direct light alone.
    Count(u32),
    /// Any number.
    All,
}

impl Bounces {
    /// Whether a path that has touched so many surfaces behind the first ends.
    pub fn end_at(self, bounce: u32) -> bool {
        matches!(self, Self::Count(count) if bounce >= count)
    }
}

impl fmt::Display for Bounces {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Count(count) => write!(f, "{count}"),
            Self::All => f.write_str("all"),
        }
    }
}

impl FromStr for Bounces {
    type Err = String;

    /// Reads a count or `all`.
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "all" {
            return Ok(Self::All);
        }
        let count = text.parse().ok().filter(|count| *count <= MAX_BOUNCES);
        count.map(Self::Count).ok_or_else(|| format!("bounces are a count up to {MAX_BOUNCES} or `all`, got `{text}`"))
    }
}

impl Bounces {
    /// So many more.
    pub fn and(self, more: Self) -> Self {
        match (self, more) {
            (Self::Count(count), Self::Count(more)) => Self::Count(count.saturating_add(more)),
            _ => Self::All,
        }
    }

    /// Whether these are fewer than others.
    pub fn are_fewer_than(self, other: Self) -> bool {
        self != other && self.max(other) == other
    }

    /// The more of two.
    pub fn max(self, other: Self) -> Self {
        match (self, other) {
            (Self::Count(count), Self::Count(other)) => Self::Count(count.max(other)),
            _ => Self::All,
        }
    }
}
