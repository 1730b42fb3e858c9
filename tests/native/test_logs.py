from __future__ import annotations

import io
import time

import numpy as np
import pytest

from kfgen import logs
from kfgen.columns import load_columns
from kfgen.errors import KfgenError

HEAD = "t,gyro,gnss.x,gnss.y,compass.heading\n"


@pytest.fixture
def read(spec, tmp_path):
    def reading(text):
        path = tmp_path / "log.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return logs.read(path, spec)

    return reading


def test_columns_in_any_order_with_a_byte_order_mark(read):
    log = read("\ufeffnote,compass.heading, gnss.y ,gnss.x,gyro,t,true.px\r\nhi,,2, 1.5 ,1e-3,0,9\r\n\r\n")
    assert log.rows == 1
    assert log.columns["gnss.x"] == [1.5]
    assert log.columns["gyro"] == [0.001]
    assert np.isnan(log.columns["compass.heading"]).all()
    assert log.columns["true.px"] == [9]
    assert log.ignored == ("note",)


def test_nan_is_an_empty_cell_and_inf_a_value(read):
    log = read(HEAD + "0,0,nan,NaN,-inf\n")
    assert np.isnan(log.columns["gnss.x"]).all()
    assert log.columns["compass.heading"] == [-np.inf]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"log is empty"),
        ("\n1,2\n", r"log is empty"),
        (HEAD, r"header but no rows"),
        ("t,gyro,gnss.x,gnss.y\n0,0,0,0\n", r"column `compass\.heading` is missing .*the log has: t, gyro"),
        (HEAD.replace("gyro", "giro") + "0,0,0,0,0\n", r"column `gyro` is missing; did you mean `giro`"),
        (HEAD.replace("gyro", "t") + "0,0,0,0,0\n", r"column `t` occurs twice"),
        (HEAD + "0,0,0,0,0\n1,0,abc,0,0\n", r"log\.csv:3: column `gnss\.x`: 'abc' is not a number"),
        (HEAD + "0,1_000,0,0,0\n", r"log\.csv:2: column `gyro`: '1_000' is not a number"),
        (HEAD + "0,0x10,0,0,0\n", r"is not a number"),
        (HEAD + "0,infinity,0,0,0\n", r"is not a number"),
        (HEAD + "0,e,0,0,0\n", r"is not a number"),
        (HEAD + "0,0,0\n", r"log\.csv:2: 3 cells, but the header has 5"),
        (HEAD + "0,0,0,0,0\n,0,0,0,0\n", r"log\.csv:3: column `t`: the time is empty or not finite"),
        (HEAD + "inf,0,0,0,0\n", r"the time is empty or not finite"),
        (HEAD + '0,"0,0,0,0\n', r"not a CSV file"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe\x00", r"not a CSV file"),
        (HEAD.encode() + b"0,0,\x00,0,0\n", r"log\.csv:2: .*"),
    ],
)
def test_what_is_wrong_with_a_log(read, text, message):
    with pytest.raises(KfgenError, match=message):
        read(text)


def test_columns_in_memory(spec):
    columns = {name: [0.0, 1.0] for name in HEAD.strip().split(",")}
    assert logs.as_log(columns, spec).rows == 2
    with pytest.raises(ValueError, match="one length"):
        logs.as_log({**columns, "t": [0.0]}, spec)


def test_numbers_are_written_as_short_as_they_read_back(tmp_path):
    columns = {
        "a": np.array([0.1, 1 / 3, np.nan, -0.0]),
        "b": np.array([0.1, 1 / 3, 1e-30, np.inf], dtype=np.float32),
        "c": np.array([0, 16, 256, 2**32 - 1], dtype=np.uint32),
    }
    stream = io.BytesIO()
    logs.write_to(stream, columns)
    lines = stream.getvalue().decode().splitlines()
    assert lines == [
        "a,b,c",
        "0.1,0.1,0",
        "0.3333333333333333,0.33333334,16",
        ",1e-30,256",
        "-0.0,inf,4294967295",
    ]
    logs.write(tmp_path / "deep" / "out.csv", columns)
    assert (tmp_path / "deep" / "out.csv").read_bytes() == stream.getvalue()


RATES = {
    "steady": (np.arange(200) * 0.1, None),
    "another origin": (1e6 + np.arange(200) * 0.1, None),
    "two rows an instant": (np.repeat(np.arange(100) * 0.1, 2), None),
    "jitter of 4 %": (np.arange(200) * 0.1 + 0.002 * (-1.0) ** np.arange(200), None),
    "one gap": (np.concatenate([np.arange(100), 130 + np.arange(100)]) * 0.1, None),
    "no step at all": (np.zeros(5), None),
    "one row": (np.zeros(1), None),
    "ten times as fast": (np.arange(200) * 0.01, r"usual step of t is 0.01 s, but dt is 0.1 s; resample"),
    "6 % off": (np.arange(200) * 0.106, "usual step"),
    "milliseconds": (np.arange(200) * 100.0, "is t in milliseconds"),
    "unsorted": (np.array([0, 0.1, 0.3, 0.2, 0.4]), "t falls in row 4, from 0.3; sort"),
    "gaps": (np.cumsum(np.where(np.arange(200) % 20, 0.1, 0.3)), "9 of 199 steps of t are longer than 1.5 dt"),
}


@pytest.mark.parametrize("name", RATES)
def test_the_rate_of_a_log(name):
    t, wrong = RATES[name]
    log = logs.Log({"t": t}, len(t))
    if wrong is None:
        logs.check_rate(log, 0.1)
        return
    with pytest.raises(KfgenError, match=wrong):
        logs.check_rate(log, 0.1)


def test_very_many_columns(read):
    header = ",".join(["t", "gyro", "gnss.x", "gnss.y", "compass.heading", *(f"c{i}" for i in range(100_000))])
    start = time.perf_counter()
    log = read(header + "\n" + "0," * 100_004 + "1\n")
    assert len(log.ignored) == 100_000
    with pytest.raises(KfgenError) as caught:
        read(header.replace("gyro", "gyr") + "\n" + "0," * 100_004 + "1\n")
    assert len(str(caught.value)) < 1000
    assert "did you mean `gyr`?" in str(caught.value)
    assert len(logs.listed(log.ignored)) < 400
    assert time.perf_counter() - start < 5


def test_semicolons_decimal_commas_and_na(read):
    log = read(HEAD.replace(",", ";") + "0,5;1,25e-1;NA;3;N/A\n1;2;-,5;;null\n")
    assert log.said == ("cells are taken to be separated by semicolons, numbers to have decimal commas",)
    assert log.columns["t"].tolist() == [0.5, 1]
    assert log.columns["gyro"].tolist() == [0.125, 2]
    assert log.columns["gnss.x"][1] == -0.5
    assert np.isnan(log.columns["compass.heading"]).all()
    assert read(HEAD.replace(",", "\t") + "0\t0.5\t0\t0\t0\n").said == ("cells are taken to be separated by tabs",)
    assert read(HEAD + "0,0,0,0,0\n").said == ()
    with pytest.raises(KfgenError, match=r"log\.csv:2: column `gyro`: '1,2,3'"):
        read(HEAD.replace(",", ";") + "0;1,2,3;0;0;0\n")


def test_foreign_names_and_units(spec, tmp_path):
    (tmp_path / "names.yaml").write_text(
        "t: {from: time_ms, scale: 1e-3}\ngyro: rate\ngnss.x: {from: east, offset: -100}\n"
        "compass.heading: {from: 'course deg', scale: 0.5}\n"
    )
    (tmp_path / "log.csv").write_text("time_ms,rate,east,gnss.y,course deg,gyro\n1500,2,103,4,90,7\n")
    log = logs.read(tmp_path / "log.csv", spec, load_columns(tmp_path / "names.yaml"))
    assert {name: column.tolist() for name, column in log.columns.items()} == {
        "t": [1.5], "gyro": [2], "gnss.x": [3], "gnss.y": [4], "compass.heading": [45],
    }  # fmt: skip
    (tmp_path / "other.csv").write_text("time_ms,rate,gnss.y,course deg\n1500,2,4,90\n")
    with pytest.raises(KfgenError, match=r"column `east`, which `gnss.x` is to come from, is missing"):
        logs.read(tmp_path / "other.csv", spec, load_columns(tmp_path / "names.yaml"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("- t\n", "columns are a mapping"),
        ("t: {form: x}\n", "unknown key `form`; did you mean `from`"),
        ("t: {from: x, scale: ms}\n", "t.scale: `scale` is a number, not text"),
        ("t: [x]\n", "a column comes from another, not from a list"),
        ("t: {from: ''}\n", "`from` names a column"),
    ],
)
def test_mistakes_in_foreign_names(tmp_path, text, said):
    (tmp_path / "names.yaml").write_text(text)
    with pytest.raises(KfgenError, match=said):
        load_columns(tmp_path / "names.yaml")


def test_parquet(spec, tmp_path):
    import pyarrow
    from pyarrow import parquet

    columns = {"t": [0, 1], "gyro": [0.5, 1.5], "gnss.x": [None, 2.0], "gnss.y": [1.0, 2.0], "compass.heading": [0, 1]}
    parquet.write_table(pyarrow.table({**columns, "note": ["a", "b"]}), tmp_path / "log.parquet")
    log = logs.read(tmp_path / "log.parquet", spec)
    assert np.isnan(log.columns["gnss.x"][0])
    assert log.columns["compass.heading"].tolist() == [0, 1]
    assert log.ignored == ("note",)
    parquet.write_table(pyarrow.table({**columns, "gyro": ["a", "b"]}), tmp_path / "log.parquet")
    with pytest.raises(KfgenError, match="column `gyro` does not hold numbers"):
        logs.read(tmp_path / "log.parquet", spec)
    (tmp_path / "no.parquet").write_bytes(b"PAR1")
    with pytest.raises(KfgenError, match="not a Parquet file"):
        logs.read(tmp_path / "no.parquet", spec)
    with pytest.raises(FileNotFoundError):
        logs.read(tmp_path / "none.parquet", spec)
