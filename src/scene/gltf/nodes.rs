//! The node tree: which nodes the chosen scene shows, and where they stand.

use super::Choice;
use super::animation::Pose;
use super::document::{Document, choose};
use crate::error::Result;
use glam::DMat4;
use gltf::json;

/// Where every node of the file stands, and which ones are shown.
pub(super) struct Nodes {
    /// World from node, for all nodes of the file.
    pub(super) world_from_node: Vec<DMat4>,
    /// Numbers of the nodes of the chosen scene, parents before children, in the order of the file.
    pub(super) shown: Vec<usize>,
}

impl Nodes {
    /// Checks that the nodes form trees and multiplies their transforms.
    pub(super) fn new(document: &Document, pose: &Pose, scene: Option<&Choice>) -> Result<Self> {
        let nodes = &document.root.nodes;
        let parents = parents(document)?;
        let roots = || (0..nodes.len()).filter(|&n| parents[n].is_none()).collect();
        let twice = |node| {
            let name = document.node_name(node);
            document.error(format!("{name} stands twice in the scene; glTF requires a tree"))
        };

        let all = depth_first(nodes, roots()).map_err(twice)?;
        // Each node has at most one parent, so that whatever no root reaches hangs on a ring.
        if all.len() < nodes.len() {
            return Err(document.error("its nodes form a ring (a node is its own ancestor); glTF requires a tree"));
        }
        let mut world_from_node = vec![DMat4::IDENTITY; nodes.len()];
        for node in all {
            let above = parents[node].map_or(DMat4::IDENTITY, |parent| world_from_node[parent]);
            world_from_node[node] = above * pose.parent_from_node[node];
            if !world_from_node[node].is_finite() {
                return Err(document.error(format!("{} has a transform that is not finite", document.node_name(node))));
            }
        }

        let tops = match chosen_scene(document, scene)? {
            Some(scene) => {
                for &index in &scene.nodes {
                    document.get(index, "a scene's node list")?;
                }
                scene.nodes.iter().map(json::Index::value).collect()
            }
            // A file without scenes is a library of parts; all of it is shown.
            None => roots(),
        };
        let mut shown = depth_first(nodes, tops).map_err(twice)?;
        // What hangs on a hidden node is hidden with it; parents stand before their children.
        let mut hidden = vec![false; nodes.len()];
        for &node in &shown {
            hidden[node] = is_hidden(&nodes[node]) || parents[node].is_some_and(|parent| hidden[parent]);
        }
        shown.retain(|&node| !hidden[node]);
        Ok(Self { world_from_node, shown })
    }
}

/// Whether KHR_node_visibility hides a node.
fn is_hidden(node: &json::Node) -> bool {
    let own = node.extensions.as_ref().and_then(|e| e.others.get("KHR_node_visibility"));
    own.and_then(|own| own.get("visible")?.as_bool()) == Some(false)
}

fn parents(document: &Document) -> Result<Vec<Option<usize>>> {
    let nodes = &document.root.nodes;
    let mut parents = vec![None; nodes.len()];
    for (parent, node) in nodes.iter().enumerate() {
        for &child in node.children.iter().flatten() {
            document.get(child, "a node's child list")?;
            if parents[child.value()].replace(parent).is_some() {
                let name = document.node_name(child.value());
                return Err(document.error(format!("{name} has two parents; glTF requires a tree")));
            }
        }
    }
    Ok(parents)
}

/// Nodes under `tops`, parents before children; the error is a node that was met twice. All children are known to
/// exist. The walk keeps its own stack, so that a deep tree cannot overflow the thread's.
fn depth_first(nodes: &[json::Node], tops: Vec<usize>) -> std::result::Result<Vec<usize>, usize> {
    let mut stack = tops;
    stack.reverse();
    let mut seen = vec![false; nodes.len()];
    let mut order = Vec::with_capacity(nodes.len());
    while let Some(node) = stack.pop() {
        if std::mem::replace(&mut seen[node], true) {
            return Err(node);
        }
        order.push(node);
        stack.extend(nodes[node].children.iter().flatten().rev().map(json::Index::value));
    }
    Ok(order)
}

pub(super) fn chosen_scene<'a>(document: &'a Document, scene: Option<&Choice>) -> Result<Option<&'a json::Scene>> {
    let root = &document.root;
    if let Some(choice) = scene {
        let names: Vec<Vec<&str>> = root.scenes.iter().map(|s| s.name.as_deref().into_iter().collect()).collect();
        return Ok(Some(&root.scenes[choose(choice, &names, "scene")?]));
    }
    let default = root.scene.map(|index| document.get(index, "the default scene")).transpose()?;
    Ok(default.or(root.scenes.first()))
}
