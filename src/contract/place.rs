//! Where the work of a node is done: by the host or by the device.

use super::{Choice, Encoder, Parameter, ParameterKind, Refusal};
use crate::schedule::Device;
use std::borrow::Cow;

/// A side of the program's memory, and who works there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The processor, in the program's own memory.
    Host,
    /// What wgpu has opened, in its memory.
    Device,
}

/// The parameter of every pass that both can do.
pub const PLACE: Parameter = Parameter {
    name: "place",
    about: "who does it",
    unit: "",
    kind: ParameterKind::Choice {
        choices: &[
            Choice { name: "Auto", about: "whoever takes less time, as far as both can; `explain` tells who and why", parameters: &[] },
            Choice { name: "Host", about: "the host", parameters: &[] },
            Choice { name: "Device", about: "the device", parameters: &[] },
        ],
    },
};

/// Largest picture whose surfaces and sums the host takes over [pixels]: 48 bytes each.
const MOST_PIXELS_ON_HOST: u64 = 1 << 23;

/// What a pass knows of who can do its work, with its arguments, inputs and scene.
pub struct Bodies {
    /// What keeps the host from it; completes "…, as …".
    pub not_on_host: Option<Cow<'static, str>>,
    /// What keeps the device from it; completes "…, as …".
    pub not_on_device: Option<Cow<'static, str>>,
    /// Who does it where it is left open, whatever the device is, and why; completes "…, as …".
    pub better: Option<(Place, &'static str)>,
}

impl Bodies {
    /// Work that both can do.
    pub const BOTH: Self = Self { not_on_host: None, not_on_device: None, better: None };

    /// The same unless this holds, which only the device can do.
    pub fn unless(mut self, holds: bool, obstacle: impl Into<Cow<'static, str>>) -> Self {
        if holds {
            self.not_on_host.get_or_insert_with(|| obstacle.into());
        }
        self
    }

    /// The same unless this holds, which only the host can do.
    pub fn unless_on_device(mut self, holds: bool, obstacle: impl Into<Cow<'static, str>>) -> Self {
        if holds {
            self.not_on_device.get_or_insert_with(|| obstacle.into());
        }
        self
    }

    /// The same where one side is the better choice whatever the device is: it has the data, say, or does the work only once.
    pub fn better_at(self, place: Place, because: &'static str) -> Self {
        Self { better: Some((place, because)), ..self }
    }
}

impl Place {
    fn name(self) -> &'static str {
        match self {
            Self::Host => "host",
            Self::Device => "device",
        }
    }
}

/// Who does some work, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Decision {
    /// Who does it.
    pub place: Place,
    /// Completes "…, as …"; None where there is nothing to tell.
    pub because: Option<Cow<'static, str>>,
}

/// Decides who does some work that `asked`, a value of [`PLACE`], leaves open or not.
///
/// The model: a GPU has done any of it before the host has waited for it and copied what it reads, so it does all that it can. A driver on the cores of the
/// host, `Software`, is slower than the host on the same cores: its lanes cannot load from places that differ, and each batch is a turn from one to the other.
/// So the host does all that it can. A pass may know better: tiles are summed where they were shaded, as a sum is far less than a tile.
///
/// # Errors
/// Where nobody can do it, or not the one that is asked for.
pub fn decide(asked: &str, device: Device, bodies: Bodies) -> Result<Decision, Refusal> {
    let Bodies { not_on_host, not_on_device, better } = bodies;
    let on = |place, because| Ok(Decision { place, because });
    match (asked, not_on_host, not_on_device) {
        (_, Some(of_host), Some(of_device)) => {
            let told = format!("the host cannot do this, as {of_host}, and the device cannot, as {of_device}");
            Err(Refusal::of_parameter(PLACE.name, "plan::place", told, "change one of the two"))
        }
        ("Host", Some(obstacle), None) => Err(refuse(Place::Host, &obstacle, Place::Device)),
        ("Device", None, Some(obstacle)) => Err(refuse(Place::Device, &obstacle, Place::Host)),
        ("Host", None, _) => on(Place::Host, None),
        ("Device", _, None) => on(Place::Device, None),
        (_, None, Some(obstacle)) => on(Place::Host, Some(obstacle)),
        (_, Some(obstacle), None) => on(Place::Device, device.is_software.then_some(obstacle)),
        (_, None, None) => {
            let usual = if device.is_software { Place::Host } else { Place::Device };
            let (place, because) = better.unwrap_or((usual, "the device is a driver on the same cores"));
            // That a GPU does its own work goes without saying.
            on(place, (device.is_software || place != usual).then_some(because.into()))
        }
    }
}

/// Why one side is refused that is asked for and cannot do it; `obstacle` completes "…, as …".
pub fn refuse(asked: Place, obstacle: &str, other: Place) -> Refusal {
    let told = format!("the {} cannot do this, as {obstacle}", asked.name());
    Refusal::of_parameter(PLACE.name, "plan::place", told, format!("set `place` to Auto or {other:?}"))
}

impl Encoder<'_> {
    /// Who does the node's work, by its parameter `place`; the reason becomes a remark.
    ///
    /// # Errors
    /// Where the one that is asked for cannot do it.
    pub fn place(&mut self, bodies: Bodies) -> Result<Place, Refusal> {
        let asked = self.arguments.choice(PLACE.name).0;
        let decided = decide(asked, self.setting.device, bodies)?;
        if let Some(because) = decided.because {
            self.remark(format!("done by the {}, as {because}", decided.place.name()));
        }
        Ok(decided.place)
    }

    /// What both can do with the surfaces and sums of all pixels: so large a picture the host does not take over.
    pub fn over_pixels(&self, size: [u32; 2]) -> Bodies {
        let [width, height] = size.map(u64::from);
        let is_large = self.setting.device.is_software && width * height > MOST_PIXELS_ON_HOST;
        if is_large { Bodies::BOTH.better_at(Place::Device, "the picture has more than 8 million pixels") } else { Bodies::BOTH }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decided(asked: &str, device: Device, bodies: Bodies) -> (Place, Option<String>) {
        let decision = decide(asked, device, bodies).unwrap_or_else(|refusal| panic!("{refusal:?}"));
        (decision.place, decision.because.map(Cow::into_owned))
    }

    #[test]
    fn a_driver_on_the_same_cores_is_relieved_and_a_gpu_is_not() {
        assert_eq!(decided("Auto", Device::SOFTWARE, Bodies::BOTH), (Place::Host, Some("the device is a driver on the same cores".into())));
        assert_eq!(decided("Auto", Device::ABLE, Bodies::BOTH), (Place::Device, None));
        for device in [Device::SOFTWARE, Device::ABLE] {
            assert_eq!(decided("Host", device, Bodies::BOTH), (Place::Host, None));
            assert_eq!(decided("Device", device, Bodies::BOTH), (Place::Device, None));
        }
    }

    #[test]
    fn work_is_done_where_its_data_lie_unless_told_otherwise() {
        for device in [Device::SOFTWARE, Device::ABLE] {
            for place in [Place::Host, Place::Device] {
                let bodies = || Bodies::BOTH.better_at(place, "they lie there");
                let goes_without_saying = !device.is_software && place == Place::Device;
                assert_eq!(decided("Auto", device, bodies()), (place, (!goes_without_saying).then(|| "they lie there".into())));
                assert_eq!(decided("Host", device, bodies()).0, Place::Host);
                // Who cannot do it does not do it.
                assert_eq!(decided("Auto", device, bodies().unless(true, "no")).0, Place::Device);
                assert_eq!(decided("Auto", device, bodies().unless_on_device(true, "no")), (Place::Host, Some("no".into())));
            }
        }
    }

    #[test]
    fn what_one_side_cannot_do_is_told_and_refused_where_it_is_asked_for() {
        let bodies = || Bodies::BOTH.unless(true, "rasters are the device's");
        assert_eq!(decided("Auto", Device::SOFTWARE, bodies()), (Place::Device, Some("rasters are the device's".into())));
        assert_eq!(decided("Auto", Device::ABLE, bodies()), (Place::Device, None));
        let refusal = decide("Host", Device::ABLE, bodies()).unwrap_err();
        assert_eq!((refusal.code, &refusal.message[..]), ("plan::place", "the host cannot do this, as rasters are the device's"));
        let neither = decide("Auto", Device::ABLE, bodies().unless_on_device(true, "walks are the host's")).unwrap_err();
        assert!(neither.message.contains("the host cannot do this, as rasters") && neither.message.contains("the device cannot, as walks"));
        // The first obstacle is told.
        assert_eq!(bodies().unless(true, "another").not_on_host.as_deref(), Some("rasters are the device's"));
        assert!(Bodies::BOTH.unless(false, "no").not_on_host.is_none());
    }
}
