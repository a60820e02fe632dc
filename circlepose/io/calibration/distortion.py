"""The lens model and its coefficients, from the keys of one camera."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.camera.lens import PINHOLE_COUNTS
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.keys import (
    COEFFICIENTS,
    DISTORTION_ROLES,
    FOCAL_ROLES,
    Field,
    is_in_fisheye_group,
    truth,
)
from circlepose.io.calibration.lens_models import is_lens_model, known_model, lens_model, plain
from circlepose.io.text.validation import some_keys

_TERM = re.compile(r"k[1-6]|p[12]|s[1-4]|tau[xy]")


def stated_model(fields: Sequence[Field], where: str) -> LensModel | None:
    """Return the lens model that the keys state; raises `CalibrationError` where they contradict each other."""
    fine: list[tuple[str, LensModel]] = []
    coarse: list[tuple[str, LensModel]] = []
    words = [each for each in fields if each.role == "model" and isinstance(each.value, str) and each.value.strip()]
    devices: list[CalibrationError] = []
    for field in fields:
        if field.role == "fisheye":
            is_fisheye = truth(field.value)
            if is_fisheye is None:
                raise CalibrationError(
                    f"{where}: {field.path}: expected 0 (pinhole) or 1 (fisheye), got {shown(field.value)}; "
                    "correct it."
                )
            fine.append((field.path, "fisheye" if is_fisheye else "pinhole"))
        elif field.role in (*FOCAL_ROLES, *DISTORTION_ROLES) and is_in_fisheye_group(field):
            fine.append((field.path, "fisheye"))
    # A camera model `pinhole` says how rays reach the lens; the distortion model is the finer statement.
    for field in sorted(words, key=lambda each: "dist" not in plain(each.path)):
        kind = fine if "dist" in plain(field.path) else coarse
        try:
            kind.append((field.path, named_model(str(field.value), where, field.path)))
        except CalibrationError as reason:
            if kind is coarse and fine and not is_lens_model(_stated_name(str(field.value))):
                # The name of a device, where the lens model is stated elsewhere.
                continue
            if not _may_be_device(field):
                raise
            devices.append(reason)
    if devices and not fine + coarse:
        text = str(devices[0]).removesuffix("correct it.")
        raise CalibrationError(f"{text}if it names a device, rename this key to device; or state the lens model.")
    if not fine + coarse:
        return None
    (key, model), *others = fine + coarse
    for other, its_model in others:
        is_coarser = bool(fine) and (other, its_model) in coarse and its_model == "pinhole"
        if its_model != model and not is_coarser:
            raise CalibrationError(
                f"{where}: {key}, {other}: contradict each other ({model}, {its_model}); keep one."
            )
    return model


def _may_be_device(field: Field) -> bool:
    """Whether a key such as camera_model may name a device: `HERO8 Black`; never a word of a lens model."""
    word = str(field.value)
    is_name = re.search(r"[0-9 ]", word.strip()) is not None
    is_lens = re.search(
        r"fish|equi|kannala|omni|pinhole|model|distort|opencv|rad|tan|poly|division|fov|mei|ucm", word, re.I
    )
    return is_name and is_lens is None and field.name in ("cameramodel", "model", "cammodel")


def named_model(word: str, where: str, key: str) -> LensModel:
    """Return the model that a text names, with or without explanations: `opencv: k1 k2 p1 p2 k3`."""
    return lens_model(_stated_name(word), where, key)


def _stated_name(word: str) -> str:
    """Return a text without the explanations behind the name of a model, unless it is one as a whole."""
    first = re.split(r"[:(,]", word)[0]
    return word if known_model(word) is not None or not plain(first) else first


def coefficients(
    fields: Sequence[Field], where: str, model: LensModel | None, *, is_needed: bool
) -> tuple[str, list[float], tuple[str, ...]]:
    """Return the key of the coefficients, they in OpenCV's order, and remarks; raises `CalibrationError`."""
    lists = [each for each in fields if each.role == "distortion"]
    named = [each for each in fields if each.role in DISTORTION_ROLES and each.role != "distortion"]
    if lists:
        for other in (*lists[1:], *named):
            raise CalibrationError(f"{where}: {lists[0].path}, {other.path}: mean the same; remove one of them.")
        key = lists[0].path
        dist = numbers.coefficients(lists[0].value, where, key)
        nothing = [each for each in fields if each.role == "model" and plain(str(each.value)) == "none"]
        if nothing and any(dist):
            raise CalibrationError(
                f"{where}: {key}, {nothing[0].path}: contradict each other (coefficients, none); name the model, or "
                "remove the coefficients."
            )
        notes: tuple[str, ...] = ()
        if model is None and len(dist) == 4 and any(dist):
            notes = (
                "the 4 coefficients are taken for a pinhole lens (k1 k2 p1 p2); "
                f"for a fisheye lens add fisheye_model: 1 to {where}",
            )
        return key, _of_list(dist, where, key, model), notes
    if named:
        return named[0].path, _in_order(_terms(named, where), where, model), ()
    if is_needed:
        raise CalibrationError(
            f"{where}: distortion_coefficients: is missing (found {some_keys(each.path for each in fields)}); "
            "if the lens has no distortion, give 5 zeros."
        )
    if model == "fisheye":
        raise CalibrationError(
            f"{where}: dist_coeffs: is missing; a fisheye camera has 4 coefficients, k1 k2 k3 k4 (all 0 where the "
            "lens follows the equidistant projection)."
        )
    return "dist_coeffs", [], ("no distortion coefficients in the file: taken for a lens without distortion",)


def _of_list(dist: list[float], where: str, key: str, model: LensModel | None) -> list[float]:
    """Return coefficients of a list; k1 alone, or k1 and k2, with the zeros that follow."""
    if model == "fisheye":
        return dist
    if len(dist) == 3:
        raise CalibrationError(
            f"{where}: {key}: a pinhole camera has {', '.join(map(str, PINHOLE_COUNTS))} coefficients, got 3, which "
            "may be k1 k2 k3 or k1 k2 p1; give k1 k2 p1 p2 k3, with 0 for a term that the lens lacks."
        )
    return dist + [0.0] * (4 - len(dist)) if dist else dist


def _terms(named: Sequence[Field], where: str) -> dict[str, tuple[str, float]]:
    """Return the terms that are given by name, each with its key."""
    by_plain = {plain(name): name for name in COEFFICIENTS}
    terms: dict[str, tuple[str, float]] = {}
    for field in named:
        if field.role == "coefficient":
            match = _TERM.search(field.name)
            names: tuple[str, ...] = (by_plain[match[0]],) if match else ()
            values = [numbers.number(field.value, where, field.path)]
        else:
            names = ("k1", "k2", "k3") if field.role == "radial" else ("p1", "p2")
            values = numbers.coefficients(field.value, where, field.path)
        if len(values) > len(names):
            raise CalibrationError(
                f"{where}: {field.path}: expected at most {len(names)} coefficients ({', '.join(names)}), got "
                f"{len(values)}; give all coefficients in OpenCV's order as dist_coeffs."
            )
        for name, value in zip(names, values, strict=False):
            if name in terms:
                raise CalibrationError(f"{where}: {terms[name][0]}, {field.path}: mean the same; remove one of them.")
            terms[name] = field.path, value
    return terms


def _in_order(terms: Mapping[str, tuple[str, float]], where: str, model: LensModel | None) -> list[float]:
    """Return coefficients that are given by name in the order of the model."""
    value = {name: terms[name][1] if name in terms else 0.0 for name in COEFFICIENTS}
    if model == "fisheye":
        names = ("k1", "k2", "k3", "k4")
        for name, (path, given) in terms.items():
            if name not in names and given:
                raise CalibrationError(
                    f"{where}: {path}: a fisheye camera has the coefficients k1 k2 k3 k4, not {name}; remove it, or "
                    "state the pinhole model."
                )
        return [value[name] for name in names]
    if value["k4"] and not ("k5" in terms and "k6" in terms):
        raise CalibrationError(
            f"{where}: {terms['k4'][0]}: is given without k5 and k6, so it is of a fisheye, or of a polynomial that "
            "OpenCV's pinhole model lacks; add `model: fisheye` if it is one, or k5 and k6 of the rational model."
        )
    last = max((COEFFICIENTS.index(name) for name, (_, given) in terms.items() if given), default=0)
    count = next(each for each in PINHOLE_COUNTS if each > last)
    return [value[name] for name in COEFFICIENTS[: max(count, 4)]]
