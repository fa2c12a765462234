//! Accessors to plain numbers, every byte range checked before it is read.

use super::document::Document;
use crate::error::Result;
use gltf::json;
use json::accessor::ComponentType;
use json::validation::Checked;

/// Largest array that one accessor may unfold to [bytes]: a sparse accessor needs no bytes in the file for its zeros,
/// so that its count alone must not decide how much memory is taken.
const MAX_ARRAY_BYTES: u64 = 1 << 30;

type Index = json::Index<json::Accessor>;

/// What an accessor says about its elements, checked.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Layout {
    /// Number of elements.
    pub(super) count: usize,
    /// Numbers in an element.
    pub(super) components: usize,
    component: ComponentType,
    normalized: bool,
}

impl Layout {
    fn element_size(&self) -> usize {
        self.component.size() * self.components
    }
}

impl Document {
    /// Shape of an accessor, without reading its data. `what` names it in errors.
    pub(super) fn layout(&self, index: Index, what: &str) -> Result<Layout> {
        let accessor = self.get(index, what)?;
        let (Checked::Valid(component), Checked::Valid(kind)) = (accessor.component_type, accessor.type_) else {
            return Err(self.error(format!("{what} (accessor {index}) has an unknown component type or type")));
        };
        let count = usize::try_from(accessor.count.0).unwrap_or(usize::MAX);
        let layout =
            Layout { count, components: kind.multiplicity(), component: component.0, normalized: accessor.normalized };
        let unfolded = accessor.count.0.saturating_mul(4 * layout.components as u64);
        if unfolded > MAX_ARRAY_BYTES {
            return Err(self.error(format!(
                "{what} (accessor {index}) has {} elements; the largest array that is read has {MAX_ARRAY_BYTES} bytes",
                accessor.count.0
            )));
        }
        Ok(layout)
    }

    /// Elements of `N` numbers each, integers normalised where the accessor says so. All numbers are finite.
    pub(super) fn vectors<const N: usize>(&self, index: Index, what: &str) -> Result<Vec<[f32; N]>> {
        let vectors = self.vectors_maybe_nan(index, what)?;
        if let Some(at) = vectors.iter().position(|v: &[f32; N]| !v.iter().all(|x| x.is_finite())) {
            return Err(self.error(format!(
                "{what} (accessor {index}): element {at} is {:?}, which is not finite; repair the mesh or export it again",
                vectors[at]
            )));
        }
        Ok(vectors)
    }

    /// As [`Document::vectors`], but NaN and infinity are let through.
    pub(super) fn vectors_maybe_nan<const N: usize>(&self, index: Index, what: &str) -> Result<Vec<[f32; N]>> {
        let layout = self.layout(index, what)?;
        if layout.components != N {
            return Err(self.error(format!(
                "{what} (accessor {index}) has {} numbers in an element, and {N} are needed",
                layout.components
            )));
        }
        let size = layout.component.size();
        self.elements(index, what, layout, |element| {
            std::array::from_fn(|i| number(&element[i * size..(i + 1) * size], layout.component, layout.normalized))
        })
    }

    /// Unsigned integers, for vertex indices.
    pub(super) fn indices(&self, index: Index, what: &str) -> Result<Vec<u32>> {
        let layout = self.layout(index, what)?;
        let unsigned = matches!(layout.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        if layout.components != 1 || !unsigned {
            return Err(self.error(format!("{what} (accessor {index}) must be unsigned integer scalars")));
        }
        self.elements(index, what, layout, unsigned_number)
    }

    /// All elements, converted one by one from their packed bytes; sparse replacements are applied.
    fn elements<T: Clone>(
        &self,
        index: Index,
        what: &str,
        layout: Layout,
        convert: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>> {
        let accessor = self.get(index, what)?;
        let size = layout.element_size();
        let mut elements = match accessor.buffer_view {
            Some(view) => {
                let stride = self.get(view, what)?.byte_stride.map_or(0, |stride| stride.0);
                let stride = if stride == 0 { size } else { stride };
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                let name = format!("{what} (accessor {index})");
                self.strided(view, offset, stride, size, layout.count, &name)?.map(&convert).collect()
            }
            None => vec![convert(&vec![0; size]); layout.count],
        };
        if let Some(sparse) = &accessor.sparse {
            let name = format!("{what} (sparse part of accessor {index})");
            let count = usize::try_from(sparse.count.0).unwrap_or(usize::MAX);
            let Checked::Valid(kind) = sparse.indices.component_type else {
                return Err(self.error(format!("{name} has an unknown index type")));
            };
            let (at, values) = (&sparse.indices, &sparse.values);
            let at = self.strided(at.buffer_view, at.byte_offset.0, kind.0.size(), kind.0.size(), count, &name)?;
            let values = self.strided(values.buffer_view, values.byte_offset.0, size, size, count, &name)?;
            for (at, value) in at.map(unsigned_number).zip(values) {
                let place = elements.get_mut(at as usize).ok_or_else(|| {
                    self.error(format!("{name} replaces element {at} of an array of {}", layout.count))
                })?;
                *place = convert(value);
            }
        }
        Ok(elements)
    }

    /// `count` slices of `size` bytes, `stride` bytes apart, from `offset` in a buffer view.
    fn strided<'a>(
        &'a self,
        view: json::Index<json::buffer::View>,
        offset: u64,
        stride: usize,
        size: usize,
        count: usize,
        name: &str,
    ) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>> {
        let bytes = self.view(view, name)?;
        if stride < size {
            return Err(self.error(format!("{name} has a stride of {stride} bytes between elements of {size} bytes")));
        }
        let needed = match count {
            0 => Some(0),
            _ => ((count - 1) as u64)
                .checked_mul(stride as u64)
                .and_then(|last| last.checked_add(size as u64)?.checked_add(offset)),
        };
        let offset = usize::try_from(offset).ok().filter(|&o| o <= bytes.len() || count == 0);
        match (needed, offset) {
            (Some(needed), Some(offset)) if needed <= bytes.len() as u64 => {
                let bytes = bytes.get(offset..).unwrap_or(&[]);
                Ok(bytes.chunks(stride).take(count).map(move |element| &element[..size]))
            }
            _ => Err(self.error(format!(
                "{name} reads {count} elements of {size} bytes past the end of buffer view {view} ({} bytes); \
                 the file is damaged or cut short",
                bytes.len()
            ))),
        }
    }
}

/// One number of the given type. Normalised integers follow section 3.11 of the glTF 2.0 specification.
fn number(bytes: &[u8], component: ComponentType, normalized: bool) -> f32 {
    let scaled = |value: f32, largest: f32| if normalized { (value / largest).max(-1.0) } else { value };
    match (component, bytes) {
        (ComponentType::I8, &[a]) => scaled(f32::from(a as i8), 127.0),
        (ComponentType::U8, &[a]) => scaled(f32::from(a), 255.0),
        (ComponentType::I16, &[a, b]) => scaled(f32::from(i16::from_le_bytes([a, b])), 32767.0),
        (ComponentType::U16, &[a, b]) => scaled(f32::from(u16::from_le_bytes([a, b])), 65535.0),
        (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as f32,
        (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        _ => unreachable!("an element is cut into pieces of its component's size"),
    }
}

fn unsigned_number(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |value, &byte| (value << 8) | u32::from(byte))
}
