//! What is measured: series of renders that differ in one thing, read from a file and checked before anything runs.

use serde::{Deserialize, Serialize};

/// The file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scaling {
    pub series: Vec<Series>,
}

/// Renders of one scene.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Series {
    pub name: String,
    pub x: Axis,
    pub scene: String,
    /// Edge of the pictures [pixels]; None where each point has its own.
    #[serde(default)]
    pub size: Option<u32>,
    /// `NODE.PARAM=VALUE` of all points.
    #[serde(default)]
    pub set: Vec<String>,
    pub points: Vec<Setting>,
    pub rows: Vec<Row>,
    /// Slopes are those of the points from here on.
    #[serde(default)]
    pub from: f64,
}

/// What grows from point to point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Axis {
    Triangles,
    Records,
    Pixels,
    /// Of a tile.
    Samples,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setting {
    #[serde(default)]
    pub size: Option<u32>,
    #[serde(default)]
    pub set: Vec<String>,
    #[serde(default)]
    pub scene_set: Vec<String>,
}

/// A pipeline that all points are rendered with.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    pub name: String,
    pub pipeline: String,
    /// After those of the series and the point.
    #[serde(default)]
    pub set: Vec<String>,
    pub lines: Vec<Costs>,
}

/// A line of the figure: the time of some nodes, on the device and on the host.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Costs {
    pub name: String,
    #[serde(default)]
    pub nodes: Vec<String>,
    /// All nodes but these, where `nodes` names none.
    #[serde(default)]
    pub except: Vec<String>,
    pub per: Per,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub enum Per {
    Record,
    Frame,
}

impl Axis {
    pub fn label(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Records => "records",
            Self::Pixels => "pixels",
            Self::Samples => "samples of a tile",
        }
    }
}

impl Per {
    pub fn label(self) -> &'static str {
        match self {
            Self::Record => "ms a record",
            Self::Frame => "ms a frame",
        }
    }
}

impl Costs {
    pub fn holds(&self, node: &str) -> bool {
        let named = |names: &[String]| names.iter().any(|name| name == node);
        if self.nodes.is_empty() { !named(&self.except) } else { named(&self.nodes) }
    }
}

impl Scaling {
    /// # Errors
    /// What is wrong with the text, in words.
    pub fn read(text: &str) -> Result<Self, String> {
        let options = ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME);
        let scaling: Self = options.from_str(text).map_err(|error| error.to_string())?;
        for series in &scaling.series {
            if series.points.len() < 2 || series.rows.is_empty() {
                return Err(format!("the series {} needs two points and a row", series.name));
            }
            if series.points.iter().any(|point| point.size.or(series.size).is_none()) {
                return Err(format!("a point of the series {} has no size", series.name));
            }
        }
        Ok(scaling)
    }

    /// The series of that name alone, or all.
    pub fn only(mut self, name: Option<&str>) -> Result<Self, String> {
        let names = self.series.iter().map(|series| series.name.clone()).collect::<Vec<_>>().join(", ");
        self.series.retain(|series| name.is_none_or(|name| series.name == name));
        if self.series.is_empty() { Err(format!("there is no series {}: it has {names}", name.unwrap_or_default())) } else { Ok(self) }
    }
}
