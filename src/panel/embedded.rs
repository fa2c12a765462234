//! The profiles that come with the library.

/// Every profile of `calib/`, by name.
pub(super) const PROFILES: &[(&str, &str)] = &[
    ("generic", include_str!("../../calib/generic.toml")),
    ("generic-amplitude", include_str!("../../calib/generic-amplitude.toml")),
    ("hamamatsu-x10468", include_str!("../../calib/hamamatsu-x10468.toml")),
    ("hamamatsu-x15213", include_str!("../../calib/hamamatsu-x15213.toml")),
    ("holoeye-gaea-2", include_str!("../../calib/holoeye-gaea-2.toml")),
    ("holoeye-leto-3", include_str!("../../calib/holoeye-leto-3.toml")),
    ("holoeye-luna", include_str!("../../calib/holoeye-luna.toml")),
    ("holoeye-pluto-2.1", include_str!("../../calib/holoeye-pluto-2.1.toml")),
    ("jasper-jd7714", include_str!("../../calib/jasper-jd7714.toml")),
    ("meadowlark-p1920", include_str!("../../calib/meadowlark-p1920.toml")),
    ("meadowlark-p1920-10", include_str!("../../calib/meadowlark-p1920-10.toml")),
    ("santec-slm-200", include_str!("../../calib/santec-slm-200.toml")),
    ("santec-slm-300-120hz", include_str!("../../calib/santec-slm-300-120hz.toml")),
    ("thorlabs-exulus-hd", include_str!("../../calib/thorlabs-exulus-hd.toml")),
    ("ti-dlp4710", include_str!("../../calib/ti-dlp4710.toml")),
    ("ti-plm-67", include_str!("../../calib/ti-plm-67.toml")),
];
