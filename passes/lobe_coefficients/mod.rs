//! The lobes of a scene as expansions.

pub mod device;

use crate::contract::{
    Arguments, Bodies, Choice, Description, Encoder, MOST_BYTES, Need, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, port,
};
use crate::host_struct;
use crate::math::{
    harmonics::{
        Harmonics, MOST,
        reflection::{LobeTable, Series, Window, energy_by_order, table_fours},
    },
    lobe::Shape,
};
use crate::passes::record::{lobe_bytes, table_places};
use crate::scene::{
    Glossy, Scene,
    needs::{Needs, used_materials},
};
use glam::Vec4;
use std::{cmp::Reverse, collections::BTreeMap, sync::Arc};

pub struct LobeCoefficients;

const ORDER: ParameterKind = ParameterKind::Integer { default: 10, min: 1, max: MOST as i64 };

static DESCRIPTION: Description = Description {
    name: "LobeCoefficients",
    about: "The lobe of every glossy material, times the cosine, on harmonics, over a grid of outgoing directions: by the host once, as the plan is made; by the device each frame anew, and then the host cannot look lobes up",
    source: "THESIS 3.5.2, equations 3.32, 3.35 and 3.36",
    parameters: &[
        Parameter {
            name: "harmonics",
            about: "the functions that lobes are expanded in",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Hemispherical", about: "those of the hemisphere, as records have them", parameters: &[] },
                    Choice { name: "Spherical", about: "those of the sphere, as 0 below the horizon; for EnvironmentLight alone", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "order",
            about: "how many degrees of harmonics are kept: n take n² coefficients",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice {
                        name: "Enough",
                        about: "of each lobe the lowest that holds it",
                        parameters: &[
                            Parameter {
                                name: "lost",
                                about: "most of a lobe's energy that may be lost (THESIS 3.32)",
                                unit: "",
                                kind: ParameterKind::Float { default: 0.0005, min: 1e-6, max: 0.9 },
                            },
                            Parameter {
                                name: "at_most",
                                about: "the highest order; lobes that would need more are blurred, or refused",
                                unit: "",
                                kind: ORDER,
                            },
                        ],
                    },
                    Choice {
                        name: "Fixed",
                        about: "the same for all lobes",
                        parameters: &[Parameter { name: "order", about: "the order", unit: "", kind: ORDER }],
                    },
                ],
            },
        },
        Parameter {
            name: "too_sharp",
            about: "what becomes of a lobe that the highest order does not hold",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Blur", about: "it is kept as blurred as the order makes it, with a remark", parameters: &[] },
                    Choice { name: "Refuse", about: "the scene is refused", parameters: &[] },
                    Choice { name: "Leave", about: "sharp lobes, as Classify tells them, are left to another pass; others are kept blurred", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "grid",
            about: "outgoing directions along an edge of the paraboloid",
            unit: "directions",
            kind: ParameterKind::Integer { default: 64, min: 2, max: 128 },
        },
        Parameter {
            name: "window",
            about: "how terms of high degree are faded out against ringing",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "None", about: "not at all", parameters: &[] },
                    Choice { name: "Hann", about: "by half a period of a cosine: no ringing, wider lobes", parameters: &[] },
                ],
            },
        },
        PLACE,
    ],
    inputs: &[],
    outputs: &[Output { name: "lobes", about: "a table for each shape of lobe", kind: PortKind::Lobes }],
};

/// The share of a lobe's energy that a fixed order may lose before it is told.
const LOST: f64 = 0.05;

/// A shape of lobe, and the materials that have it.
struct Used {
    shape: Shape,
    materials: Vec<String>,
}

host_struct! {
    /// The tables of a material: more than one where a map changes its roughness.
    pub struct MaterialTables {
        first: u32,
        /// 0 where it has none.
        count: u32,
        /// Roughness of the first, and how much each of the others has more.
        least: f32,
        step: f32,
    }
}

impl MaterialTables {
    const NONE: Self = Self { first: 0, count: 0, least: 0.0, step: 1.0 };

    fn one(first: usize) -> Self {
        Self { first: first as u32, count: 1, ..Self::NONE }
    }
}

/// Most difference in roughness between neighbouring tables.
const STEP: f32 = 1.0 / 16.0;

/// One table after the other for the roughness that maps make, from the least to the most.
fn shapes_of_maps(scene: &Scene, used: &[bool], leaves_sharp: bool) -> (Vec<Used>, MaterialTables) {
    let (mut range, mut materials) = ([f32::INFINITY, f32::NEG_INFINITY], Vec::new());
    for (material, _) in scene.materials.iter().zip(used).filter(|(material, used)| **used && material.maps.facets.is_some()) {
        let Some(Glossy::MetallicRoughness { roughness, .. }) = material.glossy else { continue };
        let [low, high] = scene.facets(material).map(|facets| facets.y * roughness);
        let low = if leaves_sharp { low.max(Shape::least_wide_roughness()) } else { low };
        if low <= high {
            range = [range[0].min(low), range[1].max(high)];
            materials.push(material.name.clone());
        }
    }
    let [least, most] = range;
    if materials.is_empty() {
        return (Vec::new(), MaterialTables::NONE);
    }
    let steps = ((most - least) / STEP).ceil();
    let step = if steps > 0.0 { (most - least) / steps } else { 1.0 };
    let shape = |level: u32| {
        let roughness = least + level as f32 * step;
        Used { shape: Shape::Microfacets { alpha: roughness * roughness }, materials: materials.clone() }
    };
    let count = steps as u32 + 1;
    ((0..count).map(shape).collect(), MaterialTables { first: 0, count, least, step })
}

/// The shapes of the lobes of the materials that are used, but for sharp ones where these are left, and of each material its tables.
fn shapes(scene: &Scene, leaves_sharp: bool) -> (Vec<Used>, Vec<MaterialTables>) {
    let used = used_materials(scene);
    let (mut shapes, of_maps) = shapes_of_maps(scene, &used, leaves_sharp);
    let of_material = scene.materials.iter().zip(used).map(|(material, used)| {
        if material.maps.facets.is_some() && matches!(material.glossy, Some(Glossy::MetallicRoughness { .. })) {
            return Some(of_maps);
        }
        let lobe = material.reflection(material.reflectance).lobe.filter(|lobe| used && !(leaves_sharp && lobe.shape.is_sharp()))?;
        let at = shapes.iter().position(|known| known.shape == lobe.shape).unwrap_or_else(|| {
            shapes.push(Used { shape: lobe.shape, materials: Vec::new() });
            shapes.len() - 1
        });
        shapes[at].materials.push(material.name.clone());
        Some(MaterialTables::one(at))
    });
    let of_material = of_material.map(|tables| tables.unwrap_or(MaterialTables::NONE)).collect();
    (shapes, of_material)
}

fn leaves_sharp(arguments: &Arguments) -> bool {
    arguments.choice("too_sharp").0 == "Leave"
}

/// The order of each lobe: as the parameter has it; those that it does not hold are told, or refused.
fn chosen_orders(e: &mut Encoder<'_>, harmonics: Harmonics, shapes: &[Used]) -> Result<Vec<u32>, Refusal> {
    let (choice, inner) = e.arguments.choice("order");
    let (lost, at_most) = match choice {
        "Enough" => (inner.float("lost"), inner.integer("at_most") as usize),
        _ => (LOST, inner.integer("order") as usize),
    };
    let mut orders = Vec::new();
    for Used { shape, materials } in shapes {
        let held = energy_by_order(*shape, harmonics, MOST);
        let enough = held.iter().position(|held| *held >= 1.0 - lost).map(|at| at + 1);
        let order = if choice == "Enough" { enough.map_or(at_most, |enough| enough.min(at_most)) } else { at_most };
        orders.push(order as u32);
        if enough.is_some_and(|enough| enough <= at_most) {
            continue;
        }
        let told = format!(
            "the lobe of {} takes order {} to keep {:.2} % of its energy; order {at_most} keeps {:.2} %",
            materials.join(", "),
            enough.map_or_else(|| format!("more than {MOST}, the highest there is,"), |enough| enough.to_string()),
            100.0 * (1.0 - lost),
            100.0 * held[at_most - 1],
        );
        if e.arguments.choice("too_sharp").0 == "Refuse" {
            return Err(Refusal::of_parameter("order", "plan::too_sharp", told, "raise the order, make the material rougher, or set too_sharp to Blur"));
        }
        e.remark(format!("{told}: it is blurred"));
    }
    if !orders.is_empty() {
        e.remark(told_orders(&orders, shapes));
    }
    Ok(orders)
}

/// "order 10 for gold, order 6 for slate and lead".
fn told_orders(orders: &[u32], shapes: &[Used]) -> String {
    let mut materials: BTreeMap<Reverse<u32>, Vec<&str>> = BTreeMap::new();
    for (order, used) in orders.iter().zip(shapes) {
        let names = materials.entry(Reverse(*order)).or_default();
        for name in &used.materials {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
    }
    let told: Vec<String> = materials.into_iter().map(|(Reverse(order), materials)| format!("order {order} for {}", listed(&materials))).collect();
    told.join(", ")
}

/// Names that a line has room for.
const NAMED: usize = 6;

fn listed(names: &[&str]) -> String {
    match names {
        [all @ .., last] if !all.is_empty() && names.len() <= NAMED => format!("{} and {last}", all.join(", ")),
        [first, .., last] if names.len() > NAMED => format!("{first} to {last}, {} materials", names.len()),
        _ => names.join(", "),
    }
}

impl Pass for LobeCoefficients {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn need(&self, arguments: &Arguments, needs: &Needs) -> Need {
        match needs.lobes {
            false => Need::Dropped("no material is glossy"),
            true if leaves_sharp(arguments) && !needs.wide_lobes => Need::Dropped("no material has a wide lobe"),
            true => Need::Kept,
        }
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let leaves_sharp = leaves_sharp(e.arguments);
        let (shapes, of_material) = shapes(e.setting.scene, leaves_sharp);
        let harmonics = if e.arguments.choice("harmonics").0 == "Spherical" { Harmonics::Spherical } else { Harmonics::Hemispherical };
        let orders = chosen_orders(e, harmonics, &shapes)?;
        let edge = e.arguments.integer("grid") as usize;
        let fours: usize = orders.iter().map(|order| table_fours(*order as usize, edge)).sum();
        if (fours * size_of::<Vec4>()) as u64 > MOST_BYTES {
            return Err(does_not_fit(shapes.len(), edge));
        }
        let window = if e.arguments.choice("window").0 == "Hann" { Window::Hann } else { Window::None };
        let series = |order: u32| Series { harmonics, order: order as usize, window };
        let lobes: Vec<Shape> = shapes.iter().map(|used| used.shape).collect();
        let of_material = e.constant_buffer("of_material", bytemuck::cast_slice(&of_material));
        let table_places = table_places(&orders, edge);
        let places = e.constant_buffer("places", bytemuck::cast_slice(&table_places));
        let (values, tables) = match e.place(Bodies::BOTH.better_at(Place::Host, "it does so once, as the plan is made"))? {
            Place::Device => {
                let highest = orders.iter().copied().max().unwrap_or(1);
                (device::encode(e, &lobes, &table_places, series(highest), edge)?, None)
            }
            Place::Host => {
                let tables: Vec<LobeTable> = lobes.into_iter().zip(&orders).map(|(shape, order)| table(e, shape, series(*order), edge)).collect();
                (e.constant_buffer("values", &lobe_bytes(&tables)), Some(Arc::new(tables)))
            }
        };
        let lobes = port::Lobes { values, places, of_material, tables, leaves_sharp, harmonics, orders, edge: edge as u32 };
        e.output("lobes", Port::Lobes(lobes));
        Ok(())
    }
}

/// Kept where it is slow to make: lobes that are alike all around take hundredths of a second, the others up to some seconds.
fn table(e: &Encoder<'_>, shape: Shape, series: Series, edge: usize) -> LobeTable {
    if !shape.is_anisotropic() {
        return LobeTable::new(shape, series, edge);
    }
    let name = format!("lobes {}: {shape:?} in {series:?}, {edge} directions a side", LobeTable::VERSION);
    let values = e.table(&name, table_fours(series.order, edge), || LobeTable::new(shape, series, edge).values);
    LobeTable { harmonics: series.harmonics, order: series.order, edge, values }
}

fn does_not_fit(shapes: usize, edge: usize) -> Refusal {
    Refusal::of_parameter(
        "grid",
        "plan::lobe_tables",
        format!("the tables of {} of lobe, {edge}×{edge} directions each, do not fit into {} MiB", plural(shapes, "shape"), MOST_BYTES >> 20),
        "lower the grid or the order, or give materials the same roughness",
    )
}

fn plural(count: usize, what: &str) -> String {
    if count == 1 { format!("one {what}") } else { format!("{count} {what}s") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    #[test]
    fn orders_are_told_from_the_highest_on_with_their_materials() {
        let used = |materials: &[&str]| Used { shape: Shape::Ward { alpha: Vec2::ONE }, materials: materials.iter().map(|name| name.to_string()).collect() };
        let shapes = [used(&["slate"]), used(&["gold"]), used(&["lead", "tin"])];
        assert_eq!(told_orders(&[6, 10, 6], &shapes), "order 10 for gold, order 6 for slate, lead and tin");
    }

    #[test]
    fn a_line_has_room_for_six_names() {
        let names = ["a", "b", "c", "d", "e", "f", "g"];
        let told = ["", "a", "a and b", "a, b and c", "a, b, c and d", "a, b, c, d and e", "a, b, c, d, e and f", "a to g, 7 materials"];
        for (count, told) in told.into_iter().enumerate() {
            assert_eq!(listed(&names[..count]), told);
        }
    }
}

#[cfg(test)]
mod orders {
    use super::*;
    use crate::contract::{Value, encoder::Setting};
    use crate::passes::mock::MockHost;
    use crate::schedule::{Device, HostContext, Schedule};

    /// A lobe that ten degrees hold, and one that they do not.
    const EXPONENTS: [f32; 2] = [3.0, 400.0];

    /// What is chosen and told, with some parameters set.
    fn chosen(set: &[(&'static str, Value)], exponents: &[f32]) -> (Result<Vec<u32>, Refusal>, Vec<String>) {
        let shapes: Vec<Used> =
            exponents.iter().map(|exponent| Used { shape: Shape::Phong { exponent: *exponent }, materials: vec![format!("m{exponent}")] }).collect();
        let mut arguments = Arguments::defaults(DESCRIPTION.parameters);
        set.iter().for_each(|(name, value)| arguments.set(name, value.clone()));
        let (host, needs, inputs, mut schedule) = (MockHost::new(Vec::new(), [4, 4]), Needs::default(), BTreeMap::new(), Schedule::default());
        let setting = Setting { scene: host.scene(), needs: &needs, device: Device::ABLE, size: [4, 4], tables: None };
        let mut e = Encoder::new("lobes", &arguments, setting, &inputs, &mut schedule);
        let orders = chosen_orders(&mut e, Harmonics::Hemispherical, &shapes);
        (orders, e.finish().remarks)
    }

    /// The lowest order that loses no more.
    fn enough(exponent: f32, lost: f64) -> Option<u32> {
        let held = energy_by_order(Shape::Phong { exponent }, Harmonics::Hemispherical, MOST);
        (1..=MOST as u32).find(|order| 1.0 - held[*order as usize - 1] <= lost)
    }

    fn fixed(order: i64) -> (&'static str, Value) {
        let parameters: &'static [Parameter] = match &DESCRIPTION.parameters[1].kind {
            ParameterKind::Choice { choices } => choices[1].parameters,
            _ => &[],
        };
        let mut inner = Arguments::defaults(parameters);
        inner.set("order", Value::Integer(order));
        ("order", Value::Choice("Fixed", inner))
    }

    #[test]
    fn each_lobe_has_the_lowest_order_that_holds_it() {
        let wide = enough(EXPONENTS[0], 0.0005).unwrap();
        assert!(wide < 10 && enough(EXPONENTS[1], 0.0005).is_none_or(|order| order > 10));
        let (orders, remarks) = chosen(&[], &EXPONENTS);
        assert_eq!(orders, Ok(vec![wide, 10]));
        let [blurred, told] = &remarks[..] else { panic!("{remarks:?}") };
        assert!(blurred.starts_with("the lobe of m400 takes order ") && blurred.contains("to keep 99.95 % of its energy; order 10 keeps"), "{blurred}");
        assert!(blurred.ends_with(": it is blurred"));
        assert_eq!(*told, format!("order 10 for m400, order {wide} for m3"));
        assert_eq!(chosen(&[], &[]), (Ok(vec![]), vec![]));
    }

    #[test]
    fn a_fixed_order_is_that_of_all_lobes() {
        let wide = enough(EXPONENTS[0], LOST).unwrap();
        let (orders, remarks) = chosen(&[fixed(wide.into())], &EXPONENTS[..1]);
        assert_eq!((orders, remarks.len()), (Ok(vec![wide]), 1));
        let (orders, remarks) = chosen(&[fixed(i64::from(wide) - 1)], &EXPONENTS[..1]);
        assert_eq!((orders, remarks.len()), (Ok(vec![wide - 1]), 2));
        assert!(remarks[0].starts_with(&format!("the lobe of m3 takes order {wide} to keep 95.00 % of its energy; order {} keeps", wide - 1)), "{remarks:?}");
    }

    #[test]
    fn lobes_that_are_too_sharp_are_refused_where_they_are_to() {
        let refuse = ("too_sharp", Value::Choice("Refuse", Arguments::defaults(&[])));
        assert!(chosen(std::slice::from_ref(&refuse), &EXPONENTS[..1]).0.is_ok());
        let (refused, _) = chosen(&[refuse], &EXPONENTS);
        let refused = refused.unwrap_err();
        assert_eq!((refused.code, refused.parameter), ("plan::too_sharp", Some("order")));
        let held = energy_by_order(Shape::Phong { exponent: EXPONENTS[1] }, Harmonics::Hemispherical, MOST);
        assert!(refused.message.ends_with(&format!("order 10 keeps {:.2} %", 100.0 * held[9])), "{}", refused.message);
    }
}
