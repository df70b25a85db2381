//! The pictures of a survey's page, from the files of its points.

use super::failure::Failure;
use super::judge::Judge;
use super::kept::Folder;
use super::truth::Truth;
use crate::measure::Layers;
use crate::measure::page::Gallery;
use crate::measure::sweep::Point;

/// A picture for each point that is measured; `keys` are those that the points are kept under.
pub(super) fn gallery(points: &[Point], keys: &[String], folder: &Folder, judge: &Judge, size: [u32; 2]) -> Result<Gallery, Failure> {
    let picture = |index: usize| points[index].measured().and_then(|_| folder.picture(&keys[index]).ok());
    let truth = if let Judge::Truth(truth, _) = judge { Some(Truth::picture(truth)) } else { None };
    let measured = points.iter().filter(|point| point.measured().is_some()).count();
    let mut gallery = Gallery::new(size, measured + usize::from(truth.is_some()));
    for index in 0..points.len() {
        let Some(own) = picture(index) else {
            gallery.skip();
            continue;
        };
        let of_row: Option<Layers> = if let Judge::Row(row) = judge { Some(row.point_of(index)).filter(|at| *at != index).and_then(picture) } else { None };
        gallery.add(&own, truth.or(of_row.as_ref())).map_err(Failure::work)?;
    }
    gallery.end_frame(None, truth).map_err(Failure::work)?;
    Ok(gallery)
}
