"""Calibrations of tools whose forms are not read, known by words that no other tool writes: the way out of each."""

from __future__ import annotations

import re
from collections.abc import Mapping

from circlepose.io.calibration.document import Document

_BEGIN = 20_000
"""characters in which a file shows what it is"""
_COLMAP = "export the model as COLMAP's cameras.txt, which is read"
_TERMS = "write fx, fy, cx, cy and k1, k2, p1, p2, k3 as YAML"
_TEXTS: tuple[tuple[str, str], ...] = (
    (
        r"(?s:.){0,2000}?^[ \t]{0,20}ParGroup:[ \t]{0,20}Camera",
        "is a HALCON camera, whose distortion runs the other way; undistort the images with HALCON (Kappa or K1 to "
        "P2 to 0), and write fx = Focus / Sx, fy = Focus / Sy, cx = Cx, cy = Cy of these, with dist_coeffs: []",
    ),
    (
        r"# Bundle file v",
        "is Bundler's result (f, k1, k2 of each image, no principal point); write fx = fy = f, cx = (width - 1) / 2, "
        "cy = (height - 1) / 2, k1 and k2 as YAML",
    ),
    (r"NVM_V\d", f"is VisualSFM's model (.nvm), whose distortion runs the other way; {_COLMAP}"),
    (
        r"Pix4D camera calibration|(?:#.*\n|\s){0,20}fileName imageWidth imageHeight",
        "is Pix4D's calibration; write fx = fy = F / (width of the sensor in mm) * (width of the image in px), cx, "
        "cy from Px, Py alike, less 0.5 px, and k1, k2, k3 = K1, K2, K3, p1, p2 = T1, T2, as YAML",
    ),
    (
        r"(?:<\?xml[^>]{0,200}\?>)?\s{0,20}<(?:ExportAPERO|CalibrationInternConique)\b",
        "is MicMac's calibration, whose distortion has a center of its own; undistort the images with MicMac (mm3d "
        "Drunk), and write fx = fy = F, cx, cy = PP of these, with dist_coeffs: []",
    ),
    (
        r"(?:<\?xml[^>]{0,200}\?>)?\s{0,20}<BlocksExchange\b",
        f"is ContextCapture's (iTwin) block; {_TERMS}: fx = fy = FocalLengthPixels, cx, cy = PrincipalPoint, less "
        "0.5 px, k1, k2, k3; of P1 and P2 other than 0 the order differs by version, so calibrate again",
    ),
    (r"(?s:.){0,2000}?\bxcr:", f"is RealityCapture's (RealityScan) XMP; {_COLMAP}"),
    (
        r"(?s:.){0,4000}?\bstCamera:",
        "is Adobe's lens profile (.lcp), in shares of the image; calibrate with OpenCV",
    ),
    (r"(?s:.){0,2000}?<lensdatabase\b", "is Lensfun's database, in shares of the image; calibrate with OpenCV"),
    (
        r"(?s:.){0,20000}?\b(?:centerPointU|focalLengthU)\s?=",
        "is Qualisys' calibration (.qca.txt, XML), in 1/64 px; convert it to TOML with Pose2Sim, which is read",
    ),
    (
        r"(?s:.){0,20000}?\bVICON_RADIAL2?\b",
        "is Vicon's calibration (.xcp); convert it to TOML with Pose2Sim, which is read",
    ),
    (
        r"(?:Pinhole|FOV|RadTan|KannalaBrandt|EquiDistant)(?:\s+-?[\d.]+(?:e[-+]?\d+)?){5,9}\s",
        f"is DSO's camera.txt; {_TERMS}: numbers in px as they stand; shares of the image below 1 times its width or "
        "height, cx and cy of these less 0.5 px; a camera `Pinhole` has dist_coeffs: [], one `FOV` no equivalent",
    ),
    (
        r"(?s:.){0,4000}?\bcam0\s?=\s?\[(?s:.){0,4000}?\b(?:doffs|ndisp)\s?=",
        "is Middlebury's calib.txt of rectified images; write cam0 as camera_matrix, with dist_coeffs: [] and "
        "image_size: [width, height], as YAML",
    ),
    (
        r"(?s:.){0,4000}?\b(?:fx_color|m_calibrationColorIntrinsic)\s?=",
        "is ScanNet's scene file; write fx = fx_color, fy = fy_color, cx = mx_color, cy = my_color (in "
        "m_calibrationColorIntrinsic the numbers 1, 6, 3, 7) and dist_coeffs: [] as YAML",
    ),
    (
        r"(?s:.){0,1000}?^P[0-3]:(?:[ \t]{1,9}-?[\d.]{1,30}(?:e[-+]?\d{1,3})?){12}[ \t]{0,9}$",
        "is KITTI's calib.txt of rectified images; write of P2, of the left color camera, the numbers 1, 6, 3, 7 as "
        "fx, fy, cx, cy, with dist_coeffs: [], as YAML",
    ),
    (
        r"(?s:.){0,4000}?^[ \t]{0,20}cam_model:(?s:.){0,4000}?^[ \t]{0,20}cam_fx:",
        "is SVO's or FAST-LIVO's camera; if cam_model is Pinhole and scale is 1, write fx, fy, cx, cy = cam_fx, "
        "cam_fy, cam_cx, cam_cy and dist_coeffs: [cam_d0, cam_d1, cam_d2, cam_d3] as YAML",
    ),
)
_KEYS: tuple[tuple[str, str], ...] = (
    (
        "CalibrationInformation",
        "is an Azure Kinect's calibration, in shares of the image; write get_camera_matrix and "
        "get_distortion_coefficients of pyk4a's calibration (k4a: k4a_calibration_get_from_raw) as JSON",
    ),
    (
        "camera_data_",
        "is Argoverse's vehicle calibration; write fx, fy = focal_length_x_px_, focal_length_y_px_, cx, cy = "
        "focal_center_x_px_, focal_center_y_px_ and k1, k2, k3 = distortion_coefficients_ of one camera as YAML",
    ),
)
_BOP = "cam_K"
_SFM = ("intrinsicId", "pxFocalLength", "distortionParams")


def kind_of_foreign(document: Document) -> str | None:
    """Return what a calibration is that is not read, and what to do, as the end of a sentence; None for others."""
    if document.text is None:
        return None
    begin = document.text.lstrip()[:_BEGIN]
    for pattern, what in _TEXTS:
        if re.match(pattern, begin, re.MULTILINE):
            return what
    if not any(f'"{word}"' in document.text for word in (*(key for key, _ in _KEYS), _BOP, *_SFM)):
        return None
    entries = document.entries
    for key, what in _KEYS:
        if key in entries:
            return what
    if isinstance(entries.get("intrinsics"), list) and any(f'"{word}"' in document.text for word in _SFM):
        return (
            "is AliceVision's (Meshroom's) scene, with offsets of the principal point from the image's center; "
            f"calibrate with OpenCV, or {_COLMAP}"
        )
    if entries and all(isinstance(each, Mapping) and _BOP in each for each in entries.values()):
        return "is BOP's scene_camera.json; write cam_K of the image as camera_matrix, with dist_coeffs: [], as YAML"
    return None
