//! How bright pictures are shown.

use super::console::Console;
use super::failure::{CommandError, Failure};
use crate::measure::Layers;
use crate::measure::exposure::automatic_exposure;
use clap::Args;
use std::path::Path;

/// The largest exposure, up or down: its factor is a number of single precision.
const MOST_STOPS: f32 = 100.0;

#[derive(Args)]
pub struct ExposureOptions {
    /// Brightens PNG files by 2^EV; if not given, the exposure is chosen from the picture
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = stops)]
    exposure: Option<f32>,
}

/// The exposure of all pictures of a command [stops]: the one that was given, or the automatic one of the first picture that is shown.
pub struct Exposure<'c> {
    stops: Option<f32>,
    console: &'c Console,
}

impl<'c> Exposure<'c> {
    pub fn new(options: &ExposureOptions, console: &'c Console) -> Self {
        Self { stops: options.exposure, console }
    }

    /// That which was chosen or given; None where no picture has needed one.
    pub fn stops(&self) -> Option<f32> {
        self.stops
    }

    /// Goes on with one that was chosen before, unless one was given.
    pub fn go_on_with(&mut self, stops: Option<f32>) {
        self.stops = self.stops.or(stops);
    }

    /// The exposure of a picture for the first file that depends on it, if there is one; the first time that it is needed it is told.
    pub fn of(&mut self, picture: &Layers, exposed: Option<&Path>) -> Result<f32, Failure> {
        let Some(first) = exposed else { return Ok(0.0) };
        if let Some(stops) = self.stops {
            return Ok(stops);
        }
        let bad = |error| Failure::work(CommandError::BadPicture { path: first.to_owned(), error });
        // What is told is what is used.
        let stops = (automatic_exposure(picture).map_err(bad)? * 100.0).round() / 100.0;
        self.console.note(&format!("note: {} is exposed by {stops:+} EV; --exposure {stops} keeps that, another number changes it", first.display()));
        self.stops = Some(stops);
        Ok(stops)
    }
}

fn stops(text: &str) -> Result<f32, String> {
    let stops = text.parse().ok().filter(|stops| (-MOST_STOPS..=MOST_STOPS).contains(stops));
    stops.ok_or_else(|| format!("expected a number of stops from -{MOST_STOPS} to {MOST_STOPS}"))
}
