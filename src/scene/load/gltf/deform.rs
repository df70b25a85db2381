//! Meshes that deform: by skins, whose joints carry vertices, and by morph targets, toward which they bend.

use super::{Reader, Vertices, broken};
use crate::{
    math::curve::Curve,
    scene::{
        animation::Post,
        load::{
            MAX_TRIANGLES,
            error::{Problem, SceneError},
        },
        shape::{Joint, Shape, Shares, Shift, Target},
    },
};
use ::gltf::{
    Accessor, Document, Mesh, Node, Primitive, Semantic,
    accessor::{DataType, Dimensions},
};
use glam::{DMat4, Vec3};
use serde_json::Value as Json;

/// Vertices of all shapes of a file, and places of such in their targets, at most.
const MAX_KEPT: usize = MAX_TRIANGLES;

/// What a file says of skins: of none that no mesh has it matters whether it is right.
#[derive(Debug, Default)]
pub(super) struct Skins {
    skins: Vec<Json>,
    /// Of each node that has one.
    of_nodes: Vec<Option<Json>>,
}

impl Skins {
    /// Of the list of a file, and what each of its nodes says of its own.
    pub fn new(skins: Option<Json>, of_nodes: Vec<Option<Json>>) -> Self {
        let skins = if let Some(Json::Array(skins)) = skins { skins } else { Vec::new() };
        Self { skins, of_nodes }
    }

    pub fn is_on(&self, node: &Node) -> bool {
        self.of_nodes.get(node.index()).is_some_and(Option::is_some)
    }

    /// That of a node, with its number.
    fn of(&self, node: &Node) -> Option<(usize, &Json)> {
        let number = whole(self.of_nodes.get(node.index())?.as_ref()?)?;
        Some((number, self.skins.get(number)?))
    }
}

fn whole(value: &Json) -> Option<usize> {
    value.as_u64().and_then(|number| usize::try_from(number).ok())
}

/// A primitive of a mesh, and how it deforms.
pub(super) struct Part {
    pub vertices: Vertices,
    pub triangles: Vec<[u32; 3]>,
    pub material: u32,
    pub targets: Vec<Target>,
    /// Of each vertex; empty where the mesh has no skin.
    pub shares: Vec<Shares>,
}

impl Part {
    /// Bends it for good.
    pub fn bend(&mut self, weights: &[Curve<f64>]) {
        self.targets.iter().zip(weights).for_each(|(target, weight)| target.bend(&mut self.vertices.all, weight.at(0.0)));
    }
}

impl Reader<'_> {
    /// The joints of a node's skin, when all nodes have their places.
    ///
    /// # Errors
    /// A skin that is not there, or whose joints or matrices are not.
    pub(super) fn joints(&self, document: &Document, node: &Node, posts: &[Option<Post>]) -> Result<Vec<Joint>, SceneError> {
        let Some((number, skin)) = self.skins.of(node) else {
            return Err(broken(self.path, &format!("node {} has a skin that is not there", node.index())));
        };
        let wrong = |why: &str| broken(self.path, &format!("skin {number} {why}"));
        let list = skin["joints"].as_array().filter(|joints| !joints.is_empty()).ok_or_else(|| wrong("has no joints"))?;
        let post = |joint: &Json| {
            let found = whole(joint).and_then(|node| *posts.get(node)?);
            found.ok_or_else(|| wrong(&format!("has a joint, node {joint}, that is no part of the scene")))
        };
        let posts = list.iter().map(post).collect::<Result<Vec<Post>, _>>()?;
        let binds = match &skin["inverseBindMatrices"] {
            Json::Null => vec![DMat4::IDENTITY; posts.len()],
            stated => {
                let accessor = whole(stated).and_then(|number| document.accessors().nth(number));
                self.read_binds(&accessor.ok_or_else(|| wrong("names an accessor for its matrices that is not there"))?)?
            }
        };
        if binds.len() < posts.len() {
            return Err(wrong(&format!("has {} matrices for its {} joints", binds.len(), posts.len())));
        }
        if let Some(joint) = binds.iter().take(posts.len()).position(|bind| !bind.is_finite()) {
            return Err(wrong(&format!("has a matrix with a number that is not finite, that of joint {joint}")));
        }
        Ok(posts.into_iter().zip(binds).map(|(post, bind)| Joint { post, bind }).collect())
    }

    fn read_binds(&self, accessor: &Accessor) -> Result<Vec<DMat4>, SceneError> {
        if accessor.data_type() != DataType::F32 || accessor.dimensions() != Dimensions::Mat4 {
            return Err(broken(self.path, &format!("accessor {} has to hold matrices of floats", accessor.index())));
        }
        Ok(self.read_vectors::<16>(accessor)?.into_iter().map(|matrix| DMat4::from_cols_array(&matrix.map(f64::from))).collect())
    }

    /// By which of so many joints each of so many vertices is carried.
    pub(super) fn read_shares(&self, primitive: &Primitive, vertices: usize, joints: usize, name: &str) -> Result<Vec<Shares>, SceneError> {
        let wrong = |why: &str| broken(self.path, &format!("{name} has a skin, {why}"));
        let mut shares = vec![Shares::new(); vertices];
        let mut first = Vec::new();
        for set in 0.. {
            let (numbers, weights) = match [Semantic::Joints(set), Semantic::Weights(set)].map(|semantic| primitive.get(&semantic)) {
                [Some(numbers), Some(weights)] => (numbers, weights),
                [None, None] if set > 0 => break,
                _ => return Err(wrong(&format!("but not both of JOINTS_{set} and WEIGHTS_{set}"))),
            };
            if !matches!(numbers.data_type(), DataType::U8 | DataType::U16) || numbers.normalized() {
                return Err(wrong(&format!("whose JOINTS_{set} are no unsigned bytes or shorts")));
            }
            let (numbers, weights) = (self.read_vectors::<4>(&numbers)?, self.read_vectors::<4>(&weights)?);
            if numbers.len() != vertices || weights.len() != vertices {
                return Err(wrong(&format!("whose JOINTS_{set} and WEIGHTS_{set} are those of other than its {vertices} vertices")));
            }
            for (vertex, (numbers, weights)) in numbers.iter().zip(&weights).enumerate() {
                for (number, weight) in numbers.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
                    if !(weight.is_finite() && *weight > 0.0) {
                        return Err(wrong(&format!("whose vertex {vertex} has a weight that is no finite number of 0 or more")));
                    }
                    if *number as usize >= joints {
                        return Err(wrong(&format!("whose vertex {vertex} is carried by joint {number} of {joints}")));
                    }
                    shares[vertex].push((*number as u32, f64::from(*weight)));
                }
            }
            if set == 0 {
                first = numbers.iter().map(|numbers| numbers[0] as u32).collect();
            }
        }
        for (shares, first) in shares.iter_mut().zip(first) {
            let sum: f64 = shares.iter().map(|(_, weight)| weight).sum();
            shares.iter_mut().for_each(|(_, weight)| *weight /= sum);
            if shares.is_empty() {
                // What no joint has a weight for goes with the first that it names.
                shares.push((if (first as usize) < joints { first } else { 0 }, 1.0));
            }
        }
        Ok(shares)
    }

    /// How many morph targets a mesh has, in all of its primitives.
    pub(super) fn count_targets(&self, mesh: &Mesh, name: &str) -> Result<usize, SceneError> {
        let mut counts = mesh.primitives().map(|primitive| primitive.morph_targets().len());
        let first = counts.next().unwrap_or(0);
        match counts.find(|count| *count != first) {
            None => Ok(first),
            Some(other) => Err(broken(self.path, &format!("{name} has primitives of {first} morph targets and of {other}"))),
        }
    }

    /// How far a mesh goes toward each of so many targets: as the animation of its node says, or the node, or the mesh.
    pub(super) fn target_weights(&mut self, node: &Node, mesh: &Mesh, targets: usize, name: &str) -> Result<Vec<Curve<f64>>, SceneError> {
        if targets == 0 {
            return Ok(Vec::new());
        }
        if let Some(animated) = self.weights.remove(&node.index()) {
            let curves = animated.curves(targets).ok_or_else(|| {
                let (found, each) = (animated.values.len(), animated.numbers_each());
                broken(self.path, &format!("the animation of the weights of {name} has {found} numbers, not {each} for each of its {targets} morph targets"))
            })?;
            if let Some(curves) = curves {
                return Ok(curves);
            }
            self.ignore(super::animation::BROKEN);
        }
        let Some(stated) = node.weights().or(mesh.weights()) else { return Ok(vec![Curve::constant(0.0); targets]) };
        if stated.len() != targets {
            return Err(broken(self.path, &format!("{name} has {} weights for {targets} morph targets", stated.len())));
        }
        if !stated.iter().all(|weight| weight.is_finite()) {
            return Err(broken(self.path, &format!("{name} has a weight of a morph target that is no finite number")));
        }
        Ok(stated.iter().map(|weight| Curve::constant(f64::from(*weight))).collect())
    }

    /// What morph targets add to vertices.
    pub(super) fn read_targets(&self, primitive: &Primitive, vertices: &Vertices, name: &str) -> Result<Vec<Target>, SceneError> {
        let count = vertices.all.len();
        let read = |accessor: Option<Accessor>| -> Result<Vec<Vec3>, SceneError> {
            let Some(accessor) = accessor else { return Ok(Vec::new()) };
            if accessor.count() != count {
                return Err(broken(self.path, &format!("{name} has {count} vertices, and a morph target of {}", accessor.count())));
            }
            let vectors = if self.has_bytes(&accessor) { self.read_vectors::<3>(&accessor)? } else { Vec::new() };
            Ok(vectors.into_iter().map(Vec3::from).collect())
        };
        let (mut targets, mut kept) = (Vec::new(), 0);
        for target in primitive.morph_targets() {
            let normals = target.normals().filter(|_| vertices.has_normals);
            let (positions, normals, tangents) = (read(target.positions())?, read(normals)?, read(target.tangents().filter(|_| vertices.has_tangents))?);
            let of = |vectors: &[Vec3], vertex: usize| vectors.get(vertex).copied().unwrap_or_default();
            let way = |vectors: &[Vec3], vertex| Some(of(vectors, vertex)).filter(|way| way.is_finite()).unwrap_or_default();
            let shift =
                |vertex| Shift { vertex: vertex as u32, position: of(&positions, vertex), normal: way(&normals, vertex), tangent: way(&tangents, vertex) };
            let target: Vec<Shift> = (0..count).map(shift).filter(|shift| *shift != Shift { vertex: shift.vertex, ..Shift::default() }).collect();
            kept += target.len();
            self.expect_to_keep(kept)?;
            targets.push(Target(target));
        }
        Ok(targets)
    }

    fn expect_to_keep(&self, count: usize) -> Result<(), SceneError> {
        if count <= MAX_KEPT {
            return Ok(());
        }
        let message =
            format!("`{}` has {count} vertices that deform, and places of such in morph targets, or more; the limit is {MAX_KEPT}", self.path.display());
        Err(SceneError::new(Problem::TooLarge, message).help("simplify the meshes that deform, or leave morph targets out"))
    }

    /// Adds a mesh whose vertices move each for itself, or one that a skin has brought to its place for good.
    pub(super) fn add_shape(&mut self, parts: &[Part], joints: Vec<Joint>, weights: Vec<Curve<f64>>, name: &str, told: &str) -> Result<(), SceneError> {
        let mut shape = Shape::new(name.to_owned(), joints, weights);
        for part in parts {
            let with_first = || (0..part.vertices.all.len()).map(|_| Shares::from_slice(&[(0, 1.0)]));
            let shares: Vec<Shares> = if part.shares.is_empty() { with_first().collect() } else { part.shares.clone() };
            shape.add(&part.vertices.all, &part.targets, shares, &part.triangles);
        }
        self.kept += shape.size();
        self.expect_to_keep(self.kept)?;
        let moment = self.draft.animation.at(0.0);
        shape.face_outward(moment.worlds());
        let posed = moment.vertices(&shape);
        let with = self.draft.move_with(None);
        let (first, mut vertex, mut triangle) = (self.draft.faces.len(), 0, 0);
        for part in parts {
            let (vertices, triangles) = (part.vertices.all.len(), part.triangles.len());
            let corners: Vec<[u32; 3]> = shape.corners[triangle..triangle + triangles].iter().map(|all| all.map(|corner| corner - vertex as u32)).collect();
            self.add_faces((&posed[vertex..vertex + vertices], &part.vertices), &corners, part.material, &DMat4::IDENTITY, told)?;
            (vertex, triangle) = (vertex + vertices, triangle + triangles);
        }
        if shape.moves() && first < self.draft.faces.len() {
            self.draft.end_shape(first, shape);
        }
        self.draft.move_with(with);
        Ok(())
    }
}
