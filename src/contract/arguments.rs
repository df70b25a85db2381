//! The values that a node gives to its pass's parameters.

use super::{Parameter, ParameterKind};
use std::collections::BTreeMap;

/// A parameter's value, already checked against its description.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Yes or no.
    Bool(bool),
    /// Of an integer parameter, within its range.
    Integer(i64),
    /// Of a parameter that may have a fraction, within its range.
    Float(f64),
    /// The choice's name and the values of its own parameters.
    Choice(&'static str, Arguments),
}

/// A value for every parameter of a description: those that the document leaves out have their defaults.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Arguments(BTreeMap<&'static str, Value>);

impl Arguments {
    /// The defaults of all parameters.
    pub fn defaults(parameters: &'static [Parameter]) -> Self {
        Self(parameters.iter().map(|p| (p.name, p.kind.default())).collect())
    }

    /// Gives a parameter another value.
    pub fn set(&mut self, name: &'static str, value: Value) {
        self.0.insert(name, value);
    }

    /// Names and values, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.0.iter().map(|(name, value)| (*name, value))
    }

    fn get(&self, name: &str) -> &Value {
        self.0.get(name).unwrap_or_else(|| unreachable!("a pass asked for the parameter {name}, which it does not describe"))
    }

    /// The value of a parameter that is yes or no.
    pub fn bool(&self, name: &str) -> bool {
        matches!(self.get(name), Value::Bool(true))
    }

    /// The value of an integer parameter.
    pub fn integer(&self, name: &str) -> i64 {
        match self.get(name) {
            Value::Integer(value) => *value,
            other => unreachable!("{name} is {other:?}, not an integer"),
        }
    }

    /// The value of a parameter that may have a fraction.
    pub fn float(&self, name: &str) -> f64 {
        match self.get(name) {
            Value::Float(value) => *value,
            other => unreachable!("{name} is {other:?}, not a float"),
        }
    }

    /// Name and arguments of the way chosen.
    pub fn choice(&self, name: &str) -> (&'static str, &Arguments) {
        match self.get(name) {
            Value::Choice(choice, arguments) => (choice, arguments),
            other => unreachable!("{name} is {other:?}, not a choice"),
        }
    }
}

impl ParameterKind {
    /// What a parameter is where a document does not say it.
    pub fn default(&self) -> Value {
        match self {
            Self::Bool { default } => Value::Bool(*default),
            Self::Integer { default, .. } => Value::Integer(*default),
            Self::Float { default, .. } => Value::Float(*default),
            Self::Choice { choices } => Value::Choice(choices[0].name, Arguments::defaults(choices[0].parameters)),
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value}"),
            Self::Choice(name, arguments) if arguments.0.is_empty() => write!(f, "{name}"),
            Self::Choice(name, arguments) => {
                let inner: Vec<_> = arguments.iter().map(|(k, v)| format!("{k}: {v}")).collect();
                write!(f, "{name}({})", inner.join(", "))
            }
        }
    }
}
