"""Parts, plans and results, against the program and by hand."""

from __future__ import annotations

import json
import threading
import time

import numpy as np
import pytest
from conftest import COARSE, ROOT, flags, without_provenance

import gripfast

BRACKET = "data/parts/l_bracket.stl"


@pytest.fixture(scope="module")
def bracket() -> gripfast.Result:
    return gripfast.plan(str(ROOT / BRACKET), "robotiq-2f85", negatives=15, **COARSE)


def test_numbers_are_those_of_the_program_bit_for_bit(program, tmp_path):
    options = {**COARSE, "accel": "1g", "loads": "gravity,ball:20:5N", "pose_noise": "1mm,1deg"}
    theirs, ours = tmp_path / "theirs.json", tmp_path / "ours.json"
    program("plan", BRACKET, "--gripper", "robotiq-2f85", "-q", "-o", str(theirs), *flags(options))
    found = gripfast.plan(BRACKET, "robotiq-2f85", **{**options, "loads": "gravity,ball:20:5N"})
    found.save(ours)
    assert without_provenance(ours) == without_provenance(theirs)
    # The text of every grip, digit for digit.
    lines = [path.read_text().split('"grips": [')[1] for path in (ours, theirs)]
    assert lines[0] == lines[1] and len(lines[0]) > 10_000
    request = json.loads(theirs.read_text())["provenance"]["request"]
    for made in (request, found.provenance["request"]):
        made["output"] = None
    assert found.provenance["request"] == request
    # A result of the program reads back, and its part with it.
    read = gripfast.read(theirs)
    assert np.array_equal(read.poses, found.poses) and len(read.part.faces) == 688
    assert len(read) == len(found) > 100


def test_arrays_are_what_the_result_file_holds(bracket):
    n = len(bracket)
    assert bracket.poses.shape == (n, 4, 4) and bracket.poses.flags["C_CONTIGUOUS"]
    assert bracket.widths.shape == bracket.mu_s.shape == (n,)
    assert bracket.worst_loads.shape == (n, 6) and bracket.contact_areas.shape == (n, 2)
    for place in (0, 1, n // 2, n - 1, -1):
        grip = bracket[place]
        assert bracket.ids[place] == grip["id"] and bracket.ranks[place] == grip["rank"]
        rotation = np.array(grip["part_from_grip"]["rotation"]).reshape(3, 3).T
        assert np.array_equal(bracket.poses[place, :3, :3], rotation)
        assert np.array_equal(bracket.poses[place, :3, 3], grip["part_from_grip"]["origin"])
        assert bracket.mu_s[place] == grip["worst"]["mu_s"]
        assert bracket.safety[place] == grip["safety"]
        assert bracket.widths[place] == grip["width"]
        wrench = grip["worst"]["wrench"]
        assert np.array_equal(bracket.worst_loads[place], wrench["force"] + wrench["moment"])
        assert bracket.worst_load_names[place] == bracket.loads[grip["worst"]["load"]]["name"]
        lower, upper = bracket.mu_bounds[place]
        assert lower <= bracket.mu_s[place] * (1 + 1e-9) and upper >= bracket.mu_s[place] * (1 - 1e-9)
    assert np.all(np.diff(bracket.scores) <= 1e-9 * bracket.scores[:-1])
    with pytest.raises(IndexError):
        bracket[n]
    assert bracket.index(int(bracket.ids[7])) == 7
    with pytest.raises(KeyError):
        bracket.index(10**9)
    assert set(bracket.statuses) <= {"ok", "ambiguous"}
    assert set(bracket.families) <= set(bracket.ids)
    assert len(list(bracket)) == n and bracket.complete


def test_contact_areas_are_those_of_their_polygons(bracket):
    def shoelace(ring):
        x, y = ring.T
        return abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2

    for place in range(0, len(bracket), 50):
        contact = bracket.contact(place)
        for side, area in zip(("face_i", "face_ii"), bracket.contact_areas[place]):
            of_rings = sum(
                shoelace(polygon["outer"]) - sum(map(shoelace, polygon["holes"]))
                for polygon in contact[side]
            )
            assert area == pytest.approx(of_rings, rel=1e-9)


def test_a_contact_of_the_result_scores_as_it_did(bracket):
    places = [0, 3, len(bracket) // 2]
    mu, statuses = gripfast.score(
        [bracket.contact(place) for place in places],
        bracket.worst_loads[places][:, None, :],
        distance=bracket.widths[places],
        force=bracket.gripper.force[1],
    )
    assert mu.shape == (3, 1) and statuses == [["ok"]] * 3
    assert mu[:, 0] == pytest.approx(bracket.mu_s[places], rel=1e-9)


def test_a_square_under_a_torque_is_the_closed_form():
    # Mean distance from the centre of a square of side a: a (sqrt 2 + asinh 1) / 6.
    side, force, torque = 0.02, 50.0, 0.2
    pad = side / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    mean = side * (np.sqrt(2) + np.arcsinh(1)) / 6
    mu, status = gripfast.score(
        [pad, (pad, pad), {"face_i": [pad], "face_ii": [pad]}],
        [[0, 0, 0, 0, 0, torque], [0, 0, 3 * force, 0, 0, 0]],
        distance=side,
        force=force,
    )
    assert mu[:, 0] == pytest.approx([torque / (2 * force * mean)] * 3, rel=1e-9)
    assert np.isnan(mu[:, 1]).all() and status[0] == ["ok", "no_normal_force"]


def test_a_part_of_arrays_is_the_part_of_the_file(bracket):
    part = gripfast.Part(BRACKET)
    assert part.name == "l_bracket" and part.watertight and not part.warnings
    assert np.allclose(np.ptp(part.vertices, axis=0), [0.06, 0.04, 0.05])
    made = gripfast.Part(part.vertices * 1e3, part.faces, unit="mm", name="mine")
    assert made.name == "mine" and made.file == ""
    found = gripfast.plan(made, gripfast.Gripper("robotiq-2f85"), **COARSE)
    assert np.allclose(found.mu_s, bracket.mu_s, rtol=1e-6)
    assert np.allclose(found.poses, bracket.poses, atol=1e-9)
    volume = part.mass_properties(2700.0)
    assert volume["mass"] == pytest.approx(2700 * volume["volume"])
    assert volume["inertia"].shape == (3, 3) and volume["centre_of_mass"].shape == (3,)
    faces = part.planar_faces
    assert faces["normal"].shape == (len(faces["area"]), 3)
    assert np.allclose(np.linalg.norm(faces["normal"], axis=1), 1)


def test_a_mesh_of_trimesh_is_a_part():
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box(extents=(60, 40, 20))
    part = gripfast.Part(box, unit="mm")
    properties = part.mass_properties(1000.0)
    assert properties["volume"] == pytest.approx(4.8e-5) and len(part.planar_faces["area"]) == 6
    found = gripfast.plan(box, "generic", mass="50g", spacing="20mm")
    assert len(found) == 0, "60 m do not fit between the jaws"
    found = gripfast.plan(part, "generic", mass="50g", spacing="20mm")
    assert len(found) > 0 and found.widths.min() == pytest.approx(0.02)
    with pytest.raises(TypeError, match="vertices and faces"):
        gripfast.Part(3)
    with pytest.raises(ValueError, match="(n, 3)"):
        gripfast.Part(np.zeros((4, 2)), np.zeros((1, 3)))
    with pytest.raises(gripfast.GeometryError, match="does not exist"):
        gripfast.Part(np.eye(3), [[0, 1, 9]])


def test_loads_of_ones_own(bracket):
    part = gripfast.Part(BRACKET)
    weight = 0.1 * 9.80665
    forces = weight * np.vstack([np.eye(3), -np.eye(3)])
    mine = gripfast.plan(
        part, "robotiq-2f85", gripfast.Loads(forces=forces, names=list("abcdef")),
        mass="100g", spacing="8mm", angle_step="90deg", backend="cpu",
    )
    theirs = gripfast.plan(
        part, "robotiq-2f85", gripfast.Loads("gravity"),
        mass="100g", spacing="8mm", angle_step="90deg", backend="cpu",
    )
    assert np.allclose(np.sort(mine.mu_s), np.sort(theirs.mu_s), rtol=1e-12)
    assert {load["name"] for load in mine.loads} == set("abcdef")
    for wrong in ({}, {"sources": "gravity", "forces": forces}, {"forces": forces, "accel": "1g"}):
        with pytest.raises(TypeError):
            gripfast.Loads(**wrong)
    with pytest.raises(ValueError):
        gripfast.Loads(forces=np.zeros(3))


def test_requests_are_those_of_the_program(program, tmp_path):
    request = gripfast.Request(
        part=ROOT / "a b.stl", gripper="generic", mass="350g", spacing="4mm", approach="-z:45deg",
        top=20, keep_out=["0mm,0mm,0mm:1mm,1mm,1mm"], pad_friction=np.float64(0.3), diverse=True,
    )
    theirs = program(
        "plan", str(ROOT / "a b.stl"), "--gripper", "generic", "--mass", "350g", "--spacing", "4mm",
        "--approach", "-z:45deg", "--top", "20", "--keep-out", "0mm,0mm,0mm:1mm,1mm,1mm",
        "--pad-friction", "0.3", "--diverse", "--print-request",
    ).stdout
    assert request.to_toml() == theirs
    assert gripfast.Request.from_toml(theirs) == request
    assert request["spacing"] == "4mm" and request["top"] == 20
    file = tmp_path / "job.json"
    file.write_text(json.dumps(request.to_dict()))
    assert gripfast.Request.read(file) == request
    request.update(density="2700kg/m3", keep_out=None, top=None, approach=None)
    assert "mass" not in request.to_dict() and request["density"] == "2700kg/m3"
    assert request["top"] == 10 and "approach" not in request.to_dict()["candidates"]
    assert "spacing='4mm'" in repr(request) and "seeds" not in repr(request)
    for wrong in ({"colour": 3}, {"spacing": 4}, {"spacing": "4"}, {"mass": "4mm"}, {"colour": None}):
        with pytest.raises(gripfast.GripfastError, match=next(iter(wrong))):
            gripfast.Request(**wrong)


@pytest.mark.parametrize(
    ("call", "kind", "base"),
    [
        (lambda: gripfast.Part("nowhere.stl"), gripfast.NotFoundError, LookupError),
        (lambda: gripfast.Gripper("nonsense"), gripfast.GripfastError, Exception),
        (lambda: gripfast.Part("README.md"), gripfast.GripfastError, Exception),
        (lambda: gripfast.plan(BRACKET, "generic"), gripfast.OptionError, ValueError),
        (lambda: gripfast.plan(BRACKET, "generic", mass="-1kg"), gripfast.OptionError, ValueError),
        (lambda: gripfast.Gripper.from_toml("x = 3"), gripfast.FormatError, ValueError),
        (lambda: gripfast.read("README.md"), gripfast.GripfastError, ValueError),
        (lambda: gripfast.Result.read("nowhere.json"), gripfast.NotFoundError, LookupError),
    ],
)
def test_exceptions_say_what_where_and_what_to_do(call, kind, base):
    with pytest.raises(kind) as caught:
        call()
    error = caught.value
    assert isinstance(error, base) and isinstance(error, gripfast.GripfastError)
    assert error.kind and error.problem and error.problem.split("\n")[0] in str(error)


def test_an_option_that_is_missing_is_named():
    with pytest.raises(gripfast.OptionError) as caught:
        gripfast.plan(BRACKET, "generic")
    assert caught.value.options == ("mass", "density") and "density" in caught.value.remedy


def test_progress_is_heard_and_an_exception_in_it_stops_the_run():
    heard, said = [], []
    found = gripfast.plan(
        BRACKET, "generic", progress=lambda *news: heard.append(news),
        notes=lambda kind, text: said.append((kind, text)), **COARSE,
    )
    done, total, grips = heard[-1]
    assert done == total == found.summary["candidates"] and grips == found.summary["ranked"]
    assert heard[0][0] == 0 and any(kind == "note" and "backend" in text for kind, text in said)

    def stop(done, total, grips):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        gripfast.plan(BRACKET, "generic", progress=stop, **COARSE)


def test_a_bar_of_tqdm_shows_the_progress(capfd):
    pytest.importorskip("tqdm")
    gripfast.plan(BRACKET, "generic", progress=True, **COARSE)
    assert "grips" in capfd.readouterr().err


def test_other_threads_run_meanwhile():
    counted, over = [0], threading.Event()

    def count():
        while not over.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    gripfast.plan(BRACKET, "generic", **{**COARSE, "spacing": "3mm", "threads": 1})
    over.set()
    thread.join()
    assert counted[0] > 20


def test_why_names_every_test(bracket):
    found = bracket.why(0)
    assert found["rejection"] is None and all(check["passed"] for check in found["checks"])
    assert any("finger" in check["name"] for check in found["checks"])
    assert found["worst"]["mu_s"] == bracket.mu_s[0]


def test_negatives_come_with_their_reasons(bracket):
    assert len(bracket.negatives) == 15
    rejections = bracket.summary["rejections"]
    assert {pose["reason"] for pose in bracket.negatives} <= set(rejections)
    assert not {pose["id"] for pose in bracket.negatives} & {int(id) for id in bracket.ids}
    table = bracket.to_arrow(negatives=True)
    assert table.num_rows == 15 and table["reason"].to_pylist()[0] in rejections


def test_arrow_and_pandas_hold_the_columns_of_the_parquet_file(bracket, tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    import pyarrow.parquet

    table = bracket.to_arrow()
    assert table["mu_s"].to_numpy().tobytes() == bracket.mu_s.tobytes()
    file = tmp_path / "grips.parquet"
    bracket.save(file)
    of_file = pyarrow.parquet.read_table(file)
    assert of_file.replace_schema_metadata(None).equals(table)
    frame = bracket.to_pandas()
    assert list(frame["id"]) == list(bracket.ids) and frame["status"].iloc[0] == "ok"
    # Whatever speaks Arrow takes the result itself.
    assert pyarrow.table(bracket).equals(table)


def test_every_export_is_the_program_s(bracket, program, tmp_path):
    native = tmp_path / "grips.json"
    bracket.save(native)
    for ending in ("csv", "moveit.yaml", "isaac_grasp.yaml", "graspgen.json", "npz", "h5", "parquet"):
        ours, theirs = tmp_path / f"ours.{ending}", tmp_path / f"theirs.{ending}"
        bracket.export(ours, top=20, origin="50mm")
        program("export", str(native), "-o", str(theirs), "--top", "20", "--origin", "50mm")
        if ending == "npz":
            a, b = np.load(ours), np.load(theirs)
            assert all(np.array_equal(a[name], b[name]) for name in b.files)
        else:
            assert ours.read_bytes() == theirs.read_bytes(), ending
    bracket.export(tmp_path / "part.glb")
    assert (tmp_path / "part.glb").read_bytes()[:4] == b"glTF"
    moved = bracket.tool_poses("moveit", "50mm")
    assert np.allclose(
        moved[:, :3, 3], bracket.poses[:, :3, 3] - 0.05 * bracket.poses[:, :3, 0], atol=1e-15
    )
    with pytest.raises(gripfast.OptionError):
        bracket.export(tmp_path / "grips.nonsense")
    with pytest.raises(gripfast.FormatError, match="colour"):
        bracket.export(tmp_path / "grips.csv", colour=3)


def test_pick_takes_the_first_grip_that_is_free(bracket):
    scene = """
[part]
position = ["400mm", "0mm", "20mm"]
[[obstacle]]
name = "table"
plane = [0, 0, 1]
position = ["0mm", "0mm", "{height}"]
"""
    place, passed = bracket.pick(scene.format(height="20mm"))
    assert place == len(passed) and place is not None
    assert all("table" in reason for reason in passed)
    lifted = np.eye(4)
    lifted[2, 3] = 5.0
    assert bracket.pick(scene.format(height="0mm"), lifted) == (0, [])
    assert bracket.pick(scene.format(height="900mm"))[0] is None
    with pytest.raises(gripfast.OptionError, match="rotation"):
        bracket.pick(scene.format(height="0mm"), 2 * np.eye(4))


def test_a_notebook_shows_the_result_and_its_page(bracket, tmp_path):
    table = bracket._repr_html_()
    assert table.count("<tr>") == 11 and f"{bracket.mu_s[0]:.5f}" in table
    page = bracket.report(tmp_path / "page.html")
    html = (tmp_path / "page.html").read_text()
    assert html == page.html and "<html" in html.lower()
    shown = page._repr_html_()
    assert shown.startswith("<iframe srcdoc=") and "&quot;" in shown


def test_a_gripper_is_data():
    assert "generic" in gripfast.Gripper.catalogue()
    gripper = gripfast.Gripper("franka-hand")
    assert gripper.stroke[1] == pytest.approx(0.08) and "Franka" in gripper.name
    again = gripfast.Gripper.from_dict(gripper.to_dict())
    assert again.to_dict() == gripper.to_dict()
    text = (ROOT / "data/grippers/franka-hand.toml").read_text()
    assert gripfast.Gripper.from_toml(text).to_dict() == gripper.to_dict()


def test_poses_from_outside_are_scored_as_the_program_does(bracket, program, tmp_path):
    again = bracket.assess(bracket.poses)
    assert len(again) == len(bracket) == len(again.result)
    assert all(row["free"] for row in again) and again.verdicts[0] == "holds"
    assert np.allclose(again.mu_s, bracket.mu_s, rtol=1e-9, atol=0)
    # As tool frames, and as a file.
    tools = bracket.assess(
        bracket.tool_poses("moveit", "flange"), convention="moveit", origin="flange"
    )
    assert np.allclose(tools.mu_s, bracket.mu_s, rtol=1e-6, atol=0)
    path = tmp_path / "poses.csv"
    bracket.export(path)
    base = {k: v for k, v in COARSE.items() if k in ("mass", "accel", "density")}
    filed = gripfast.assess(str(ROOT / BRACKET), "robotiq-2f85", path, **base)
    done = program(
        "assess", BRACKET, "--poses", str(path), "-g", "robotiq-2f85", "--json", *flags(base)
    )
    assert filed.rows == json.loads(done.stdout)["poses"] and len(filed) == len(bracket)
    # The same from Parquet, in single precision and with whole numbers for names, as others write it.
    pandas = pytest.importorskip("pandas")
    table = pandas.read_csv(path)
    columns = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "jaw_gap_m"]
    for kind, tolerance in ((np.float64, 0), (np.float32, 1e-3)):
        table[columns].astype(kind).assign(id=table["id"]).to_parquet(tmp_path / "poses.parquet")
        again = gripfast.assess(
            str(ROOT / BRACKET), "robotiq-2f85", tmp_path / "poses.parquet", **base
        )
        assert [row["name"] for row in again] == [row["name"] for row in filed]
        assert np.allclose(again.mu_s, filed.mu_s, rtol=tolerance, atol=0)
    # Turned by more than jaws right, and away from the part.
    wrong = bracket.poses[:2].copy()
    turn = np.array([[1, 0, 0], [0, np.cos(0.3), -np.sin(0.3)], [0, np.sin(0.3), np.cos(0.3)]])
    wrong[0, :3, :3] = wrong[0, :3, :3] @ turn
    wrong[1, :3, 3] += 0.5
    found = bracket.assess(wrong)
    assert len(found.result) == 0 and not any(row["free"] for row in found)
    assert found.verdicts[0].startswith("no faces") and np.isnan(found.mu_s).all()
    with pytest.raises(gripfast.OptionError, match="rotation"):
        bracket.assess(np.ones((1, 4, 4)))
