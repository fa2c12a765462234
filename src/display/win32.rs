//! What Windows tells of its monitors: EDID, rotation, scaling, mirroring, the card's gamma table, HDR, night light.
//!
//! The only file of the display that calls Windows itself; what it returns are values of the house. Each call fills a structure
//! of ours whose size it is told, and what it does not fill stays zero, so that a system that does not answer (an old
//! one, a remote session) leaves a thing unknown and nothing undefined.

use super::edid::Edid;
use super::monitor::{Gamma, Monitor, ScanOut};
use std::ptr::null;
use windows_sys::Win32::Devices::Display as dc;
use windows_sys::Win32::Foundation::{ERROR_SUCCESS, LUID};
use windows_sys::Win32::Graphics::Gdi;
use windows_sys::Win32::System::Power::{ES_CONTINUOUS, ES_DISPLAY_REQUIRED, SetThreadExecutionState};
use windows_sys::Win32::System::Registry::{
    HKEY, HKEY_CURRENT_USER, HKEY_LOCAL_MACHINE, RRF_RT_REG_BINARY, RegGetValueW,
};
use windows_sys::Win32::UI::ColorSystem::GetDeviceGammaRamp;
use windows_sys::Win32::UI::WindowsAndMessaging::EDD_GET_DEVICE_INTERFACE_NAME;

/// What Windows puts before the name of a display: `\\.\DISPLAY1`.
pub(super) const PREFIX: &str = r"\\.\";
/// Where monitors' EDIDs are kept.
const MONITORS: &str = r"SYSTEM\CurrentControlSet\Enum\DISPLAY";
/// Where the shell keeps whether night light is on.
const NIGHT_LIGHT: &str = r"Software\Microsoft\Windows\CurrentVersion\CloudStore\Store\DefaultAccount\Current\default$windows.data.bluelightreduction.bluelightreductionstate\windows.data.bluelightreduction.bluelightreductionstate";
/// Longest value of the registry that is read: an EDID with all its extensions [bytes].
const VALUE_LIMIT: u32 = 256 * 128;
/// The state in the answer on advanced colour (HDR): whether it is on.
const ADVANCED_COLOUR_ENABLED: u32 = 2;

/// Adds what Windows tells to monitors that winit has listed.
pub(super) fn complete(monitors: &mut [Monitor]) {
    let paths = paths();
    for monitor in monitors {
        let device = format!("{PREFIX}{}", monitor.name);
        monitor.edid = interface(&device).and_then(|name| edid(&name));
        let own: Vec<&Path> = paths.iter().filter(|path| path.device == device).collect();
        if let Some(path) = own.first() {
            // One pixel of a window, in a process that Windows stretches, is not one of the desktop.
            monitor.scale = f64::from(path.width) / f64::from(monitor.width.max(1));
        }
        monitor.scan_out = Some(ScanOut {
            rotated: own.iter().any(|path| path.rotated),
            transformed: own.iter().any(|path| path.scaled),
            gamma: gamma(&device),
            high_dynamic_range: own.iter().filter_map(|path| path.hdr).reduce(|a, b| a || b),
            shared_with: own.iter().skip(1).map(|path| path.monitor.clone()).collect(),
            preferred: own.first().and_then(|path| path.preferred),
        });
    }
}

/// Keeps the monitors on from now on, or no longer.
pub(super) fn keep_awake(awake: bool) {
    // SAFETY: takes and returns flags. A refusal (0) leaves the system's own timers, no worse than before.
    unsafe {
        SetThreadExecutionState(if awake { ES_CONTINUOUS | ES_DISPLAY_REQUIRED } else { ES_CONTINUOUS });
    }
}

/// Whether the shell's night light colours the desktop now; none where it does not tell.
///
/// Microsoft documents no way to ask; the state's nineteenth byte is 0x15 while it is on and 0x13 while it is off.
pub(super) fn night_light() -> Option<bool> {
    match registry(HKEY_CURRENT_USER, NIGHT_LIGHT, "Data")?.get(18)? {
        0x15 => Some(true),
        0x13 => Some(false),
        _ => None,
    }
}

/// One monitor and the part of the desktop that it shows.
struct Path {
    device: String,
    monitor: String,
    /// Columns of the desktop's picture [px].
    width: u32,
    rotated: bool,
    scaled: bool,
    preferred: Option<(u32, u32)>,
    hdr: Option<bool>,
}

/// All that are lit; none where the system does not tell.
fn paths() -> Vec<Path> {
    let (mut count, mut modes) = (0, 0);
    // SAFETY: both counts are ours.
    let sizes = unsafe { dc::GetDisplayConfigBufferSizes(dc::QDC_ONLY_ACTIVE_PATHS, &mut count, &mut modes) };
    if sizes != ERROR_SUCCESS {
        return Vec::new();
    }
    let mut path_list = vec![dc::DISPLAYCONFIG_PATH_INFO::default(); count as usize];
    let mut mode_list = vec![dc::DISPLAYCONFIG_MODE_INFO::default(); modes as usize];
    // SAFETY: the lists have as many elements as the counts say; the call writes no more and corrects the counts.
    let told = unsafe {
        dc::QueryDisplayConfig(
            dc::QDC_ONLY_ACTIVE_PATHS,
            &mut count,
            path_list.as_mut_ptr(),
            &mut modes,
            mode_list.as_mut_ptr(),
            std::ptr::null_mut(),
        )
    };
    if told != ERROR_SUCCESS {
        return Vec::new();
    }
    path_list.truncate(count as usize);
    mode_list.truncate(modes as usize);
    path_list.iter().filter_map(|path| path_of(path, &mode_list)).collect()
}

fn path_of(path: &dc::DISPLAYCONFIG_PATH_INFO, modes: &[dc::DISPLAYCONFIG_MODE_INFO]) -> Option<Path> {
    let (source, target) = (&path.sourceInfo, &path.targetInfo);
    let name = asked::<dc::DISPLAYCONFIG_SOURCE_DEVICE_NAME>(
        dc::DISPLAYCONFIG_DEVICE_INFO_GET_SOURCE_NAME,
        source.adapterId,
        source.id,
        |name| &mut name.header,
    );
    let name = name?;
    // SAFETY: paths were asked for without virtual modes, of which the union's other member tells; any number is valid here.
    let (source_mode, target_mode) = unsafe { (source.Anonymous.modeInfoIdx, target.Anonymous.modeInfoIdx) };
    let source_mode =
        modes.get(source_mode as usize).filter(|mode| mode.infoType == dc::DISPLAYCONFIG_MODE_INFO_TYPE_SOURCE)?;
    // SAFETY: the mode says that it is that of a source.
    let desktop = unsafe { source_mode.Anonymous.sourceMode };
    let signal = modes
        .get(target_mode as usize)
        .filter(|mode| mode.infoType == dc::DISPLAYCONFIG_MODE_INFO_TYPE_TARGET)
        // SAFETY: the mode says that it is that of a target.
        .map(|mode| unsafe { mode.Anonymous.targetMode.targetVideoSignalInfo.activeSize });
    let (adapter, id) = (target.adapterId, target.id);
    let called = asked::<dc::DISPLAYCONFIG_TARGET_DEVICE_NAME>(
        dc::DISPLAYCONFIG_DEVICE_INFO_GET_TARGET_NAME,
        adapter,
        id,
        |name| &mut name.header,
    );
    let preferred = asked::<dc::DISPLAYCONFIG_TARGET_PREFERRED_MODE>(
        dc::DISPLAYCONFIG_DEVICE_INFO_GET_TARGET_PREFERRED_MODE,
        adapter,
        id,
        |mode| &mut mode.header,
    );
    let colour = asked::<dc::DISPLAYCONFIG_GET_ADVANCED_COLOR_INFO>(
        dc::DISPLAYCONFIG_DEVICE_INFO_GET_ADVANCED_COLOR_INFO,
        adapter,
        id,
        |colour| &mut colour.header,
    );
    let called = called.map(|called| text(&called.monitorFriendlyDeviceName)).filter(|name| !name.is_empty());
    Some(Path {
        device: text(&name.viewGdiDeviceName),
        monitor: called.unwrap_or_else(|| "another monitor".into()),
        width: desktop.width,
        rotated: target.rotation > dc::DISPLAYCONFIG_ROTATION_IDENTITY,
        // A turned picture has its sides exchanged, and is found as turned.
        scaled: signal.is_some_and(|signal| {
            let (wide, high) = (desktop.width, desktop.height);
            signal.cx > 0 && ![(wide, high), (high, wide)].contains(&(signal.cx, signal.cy))
        }),
        preferred: preferred.map(|mode| (mode.width, mode.height)).filter(|&(width, height)| width > 0 && height > 0),
        // SAFETY: the answer's flags, as one number; the union's other member is the same number.
        hdr: colour.map(|colour| unsafe { colour.Anonymous.value } & ADVANCED_COLOUR_ENABLED != 0),
    })
}

/// The answer to a question about a source or a target; none where the system does not understand it.
fn asked<T: Default>(
    kind: dc::DISPLAYCONFIG_DEVICE_INFO_TYPE,
    adapter: LUID,
    id: u32,
    header: fn(&mut T) -> &mut dc::DISPLAYCONFIG_DEVICE_INFO_HEADER,
) -> Option<T> {
    let mut question = T::default();
    let size = size_of::<T>() as u32;
    *header(&mut question) = dc::DISPLAYCONFIG_DEVICE_INFO_HEADER { r#type: kind, size, adapterId: adapter, id };
    // SAFETY: every question begins with its header, which says how large the whole of it is.
    let answer = unsafe { dc::DisplayConfigGetDeviceInfo(std::ptr::from_mut(&mut question).cast()) };
    (answer == 0).then_some(question)
}

/// The table that the graphics card looks levels up in.
fn gamma(device: &str) -> Gamma {
    let device = wide(device);
    let mut table = [[0u16; 256]; 3];
    // SAFETY: the name ends in a zero; the table is as large as the call fills; the context is given back.
    let read = unsafe {
        let context = Gdi::CreateDCW(device.as_ptr(), device.as_ptr(), null(), null());
        if context.is_null() {
            return Gamma::Unknown;
        }
        let read = GetDeviceGammaRamp(context, table.as_mut_ptr().cast());
        Gdi::DeleteDC(context);
        read
    };
    if read == 0 { Gamma::Unknown } else { Gamma::of_table(&table[0], &table[1], &table[2]) }
}

/// The name of the device interface of the lit monitor on a display:
/// `\\?\DISPLAY#HOE2101#5&1a2b3c&0&UID4352#{e6f07b5f-ee97-4a90-b076-33f57bf4eaa7}`.
fn interface(device: &str) -> Option<String> {
    let device = wide(device);
    for number in 0.. {
        let mut found =
            Gdi::DISPLAY_DEVICEW { cb: size_of::<Gdi::DISPLAY_DEVICEW>() as u32, ..Gdi::DISPLAY_DEVICEW::default() };
        // SAFETY: the name ends in a zero, and the structure says how large it is.
        let there =
            unsafe { Gdi::EnumDisplayDevicesW(device.as_ptr(), number, &mut found, EDD_GET_DEVICE_INTERFACE_NAME) };
        if there == 0 {
            return None;
        }
        if found.StateFlags & Gdi::DISPLAY_DEVICE_ACTIVE != 0 {
            return Some(text(&found.DeviceID));
        }
    }
    None
}

/// The EDID of a monitor by the name of its device interface. Too damaged to read, it identifies nothing.
fn edid(interface: &str) -> Option<Edid> {
    registry(HKEY_LOCAL_MACHINE, &key_of(interface)?, "EDID").and_then(|bytes| Edid::parse(&bytes).ok())
}

/// The registry's key for a device interface.
fn key_of(interface: &str) -> Option<String> {
    let mut parts = interface.split('#');
    let (model, instance) = parts.nth(1).zip(parts.next())?;
    Some(format!(r"{MONITORS}\{model}\{instance}\Device Parameters"))
}

/// Bytes of a value of the registry.
fn registry(root: HKEY, key: &str, value: &str) -> Option<Vec<u8>> {
    let (key, value) = (wide(key), wide(value));
    let mut bytes = vec![0u8; VALUE_LIMIT as usize];
    let mut length = VALUE_LIMIT;
    // SAFETY: names end in zeros; no more bytes are written than the length says, which is that of the memory.
    let read = unsafe {
        RegGetValueW(
            root,
            key.as_ptr(),
            value.as_ptr(),
            RRF_RT_REG_BINARY,
            std::ptr::null_mut(),
            bytes.as_mut_ptr().cast(),
            &mut length,
        )
    };
    bytes.truncate(length as usize);
    (read == ERROR_SUCCESS).then_some(bytes)
}

/// Text as Windows takes it: UTF-16 that ends in a zero.
fn wide(text: &str) -> Vec<u16> {
    text.encode_utf16().chain([0]).collect()
}

/// Text up to the zero that ends it.
fn text(wide: &[u16]) -> String {
    let end = wide.iter().position(|&unit| unit == 0).unwrap_or(wide.len());
    String::from_utf16_lossy(&wide[..end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_monitors_key_is_found_by_its_interface() {
        let interface = r"\\?\DISPLAY#HOE2101#5&1a2b3c&0&UID4352#{e6f07b5f-ee97-4a90-b076-33f57bf4eaa7}";
        let key = r"SYSTEM\CurrentControlSet\Enum\DISPLAY\HOE2101\5&1a2b3c&0&UID4352\Device Parameters";
        assert_eq!(key_of(interface).as_deref(), Some(key));
        assert_eq!((key_of(""), key_of(r"\\?\DISPLAY#HOE2101")), (None, None));
        assert_eq!(edid(interface), None);
    }

    #[test]
    fn values_of_the_registry_are_read_and_what_is_not_there_is_none() {
        assert_eq!(registry(HKEY_CURRENT_USER, r"Software\No such key", "Data"), None);
        assert_eq!(text(&wide("Großer Schirm")), "Großer Schirm");
        assert_eq!((interface(r"\\.\DISPLAY99"), gamma(r"\\.\DISPLAY99")), (None, Gamma::Unknown));
    }
}
