"""Command lines to copy, shown at the end of a command's help."""

from __future__ import annotations

from collections.abc import Mapping

EXAMPLES: Mapping[str, str] = {
    "estimate": """\
circlepose estimate photo.png --calib cam.yaml --radius-mm 60
circlepose estimate imgs/ --target rings.yaml -o poses.csv
circlepose estimate imgs/ --radius-mm 35 --count all --chosen-only
circlepose estimate photo.png --facing up --overlay checked/
circlepose estimate imgs/ -r --columns image,center_z_mm,sigma_z_mm""",
    "check": """\
circlepose check poses.csv --against baseline.csv
circlepose check poses.csv --against truth.csv --candidate best
circlepose check poses.csv --against baseline.csv --update
circlepose estimate imgs/ | circlepose check - --against baseline.csv""",
    "inspect": """\
circlepose inspect photo.png
circlepose inspect photo.png --picture found.png
circlepose inspect photo.png --rings --major-px 100:400""",
    "explain": """\
circlepose explain photo.png --calib cam.yaml --radius-mm 60
circlepose explain photo.png --picture why.png
circlepose explain photo.png --format json""",
    "camera": """\
circlepose camera cam.yaml
circlepose camera cam.yaml --to ros -o camera_info.yaml
circlepose camera camchain.yaml --camera-name cam1 --to opencv -o cam1.xml""",
    "print": """\
circlepose print target.yaml -o sheet.svg
circlepose print board.yaml -o board.pdf --paper A4
circlepose print rings.yaml -o rings.dxf --light-on-dark
circlepose print --suggest -o b.pdf --calib cam --paper A3 --distance-mm 800""",
    "plan": """\
circlepose plan --calib cam.yaml --radius-mm 20 --distance-mm 300:1500
circlepose plan --calib cam.yaml --target board.yaml --distance-mm 800
circlepose plan --calib c.yml --radius-mm 9 --distance-mm 50:999 --sigma-mm 1""",
    "completion": """\
circlepose completion bash >> ~/.bashrc
circlepose completion zsh > ~/.zfunc/_circlepose
circlepose completion fish > ~/.config/fish/completions/circlepose.fish""",
}
