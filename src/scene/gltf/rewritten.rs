//! What of a file is put into other words before its schema reads it: what newer and older exporters write, as plain glTF.

use crate::scene::Warning;
use serde_json::{Value, json};

/// Puts the file's JSON into words that the schema knows:
///
/// - animation channels without a target node (KHR_animation_pointer) are left out, with a warning;
/// - a scene without a list of nodes has an empty one;
/// - a texture's picture is that of EXT_texture_webp where it has one, and that of KHR_texture_basisu where it has no other;
/// - KHR_materials_pbrSpecularGlossiness becomes metallic and roughness.
pub(super) fn rewrite(file: &mut Value, warnings: &mut Vec<Warning>) {
    let pointers: usize = list(file, "animations").map(nodeless_channels).sum();
    if pointers > 0 {
        warnings.push(Warning(format!(
            "{pointers} animation channels move no node (KHR_animation_pointer) and are left out"
        )));
    }
    for scene in list(file, "scenes").filter_map(Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| json!([]));
    }
    for texture in list(file, "textures").filter_map(Value::as_object_mut) {
        let of = |name: &str| texture.get("extensions")?.get(name)?.get("source").cloned();
        let plain = texture.get("source").cloned();
        if let Some(source) = of("EXT_texture_webp").or(plain).or(of("KHR_texture_basisu")) {
            texture.insert("source".into(), source);
        }
    }
    let glossy = list(file, "materials").filter_map(from_glossiness).count();
    if glossy > 0 {
        warnings.push(Warning(format!(
            "{glossy} materials of KHR_materials_pbrSpecularGlossiness are taken as metallic and rough, their glossiness \
             without its picture"
        )));
    }
}

/// The entries of one of the file's lists.
fn list<'a>(file: &'a mut Value, key: &str) -> impl Iterator<Item = &'a mut Value> {
    file.get_mut(key).and_then(Value::as_array_mut).into_iter().flatten()
}

/// Leaves out an animation's channels that have no node; how many there were.
fn nodeless_channels(animation: &mut Value) -> usize {
    let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { return 0 };
    let before = channels.len();
    channels.retain(|channel| {
        channel.get("target").is_none_or(|target| !target.is_object() || target.get("node").is_some())
    });
    before - channels.len()
}

/// Reflectance at normal incidence of what is no metal.
const DIELECTRIC: f64 = 0.04;

/// Writes a material's specular and glossy factors as metallic and rough ones; `None` where there are none.
fn from_glossiness(material: &mut Value) -> Option<()> {
    let own = material.get("extensions")?.get("KHR_materials_pbrSpecularGlossiness")?.clone();
    let numbers = |key: &str, count: usize| -> Vec<f64> {
        let given: Vec<f64> =
            own.get(key).and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_f64).collect();
        if given.len() == count { given } else { vec![1.0; count] }
    };
    let (diffuse, specular) = (numbers("diffuseFactor", 4), numbers("specularFactor", 3));
    let glossiness = own.get("glossinessFactor").and_then(Value::as_f64).unwrap_or(1.0);
    let pictured = own.get("specularGlossinessTexture").is_some();
    // Where a picture says what shines, factors alone say nothing of metal.
    let metallic = if pictured { 0.0 } else { metalness(&diffuse, &specular) };
    let strongest = specular.iter().copied().fold(0.0, f64::max);
    let mut base: Vec<f64> = (0..3)
        .map(|c| {
            let from_diffuse = diffuse[c] * (1.0 - strongest) / (1.0 - DIELECTRIC) / (1.0 - metallic).max(1e-6);
            let from_specular = (specular[c] - DIELECTRIC * (1.0 - metallic)) / metallic.max(1e-6);
            let diffuse = if pictured { diffuse[c] } else { from_diffuse };
            (diffuse + (from_specular - diffuse) * metallic * metallic).clamp(0.0, 1.0)
        })
        .collect();
    base.push(diffuse[3]);
    let mut written = json!({
        "baseColorFactor": base, "metallicFactor": metallic, "roughnessFactor": (1.0 - glossiness).clamp(0.0, 1.0)
    });
    if let Some(texture) = own.get("diffuseTexture") {
        written["baseColorTexture"] = texture.clone();
    }
    *material.as_object_mut()?.entry("pbrMetallicRoughness").or_insert(Value::Null) = written;
    Some(())
}

/// The metalness at which both models have the same brightness (Khronos' own conversion).
fn metalness(diffuse: &[f64], specular: &[f64]) -> f64 {
    let bright = |c: &[f64]| (0.299 * c[0] * c[0] + 0.587 * c[1] * c[1] + 0.114 * c[2] * c[2]).sqrt();
    let (diffuse, shine) = (bright(diffuse), bright(specular));
    if shine < DIELECTRIC {
        return 0.0;
    }
    let left = 1.0 - specular.iter().copied().fold(0.0, f64::max);
    let b = diffuse * left / (1.0 - DIELECTRIC) + shine - 2.0 * DIELECTRIC;
    let d = (b * b - 4.0 * DIELECTRIC * (DIELECTRIC - shine)).max(0.0);
    ((-b + d.sqrt()) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn newer_and_older_words_become_plain_ones() {
        let mut file = json!({
            "scenes": [{}, {"nodes": [0]}],
            "animations": [{"channels": [{"target": {"path": "pointer"}}, {"target": {"node": 0, "path": "scale"}}]}],
            "textures": [
                {"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}},
                {"source": 0, "extensions": {"KHR_texture_basisu": {"source": 1}}},
                {"extensions": {"KHR_texture_basisu": {"source": 1}}}
            ],
            "materials": [
                {"extensions": {"KHR_materials_pbrSpecularGlossiness": {
                    "diffuseFactor": [0.8, 0.1, 0.1, 0.5], "specularFactor": [0, 0, 0], "glossinessFactor": 0.25,
                    "diffuseTexture": {"index": 0}
                }}},
                {"extensions": {"KHR_materials_pbrSpecularGlossiness": {
                    "diffuseFactor": [0, 0, 0, 1], "specularFactor": [0.9, 0.6, 0.1]
                }}}
            ]
        });
        let mut warnings = Vec::new();
        rewrite(&mut file, &mut warnings);
        assert_eq!(file["scenes"][0]["nodes"], json!([]));
        assert_eq!(file["animations"][0]["channels"].as_array().map(Vec::len), Some(1));
        assert_eq!([0, 1, 2].map(|i| file["textures"][i]["source"].as_u64()), [Some(1), Some(0), Some(1)]);
        let pbr = |i: usize, key: &str| file["materials"][i]["pbrMetallicRoughness"][key].clone();
        assert_eq!((pbr(0, "metallicFactor"), pbr(0, "roughnessFactor")), (json!(0.0), json!(0.75)));
        assert_eq!(pbr(0, "baseColorTexture"), json!({"index": 0}));
        let red = pbr(0, "baseColorFactor")[0].as_f64().expect("red");
        assert!((red - 0.8 / 0.96).abs() < 0.05 && pbr(0, "baseColorFactor")[3] == json!(0.5), "{red}");
        // Black with a coloured shine is a metal of that colour.
        let metal: Vec<f64> =
            pbr(1, "baseColorFactor").as_array().expect("colour").iter().filter_map(Value::as_f64).collect();
        assert!(pbr(1, "metallicFactor").as_f64() > Some(0.9) && (metal[0] - 0.9).abs() < 0.05, "{metal:?}");
        assert_eq!(warnings.len(), 2);
        // Whatever it is, it does not panic.
        for odd in
            [json!(null), json!([]), json!({"scenes": 3, "textures": [null, 1], "animations": [{"channels": [{}]}]})]
        {
            rewrite(&mut odd.clone(), &mut Vec::new());
        }
    }
}
