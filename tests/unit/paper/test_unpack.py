"""Unpacking of archives, honest ones and hostile ones."""

import copy
import gzip
import io
import os
import stat
import tarfile
import zipfile

import pytest

from sgf_paper import unpack
from sgf_paper.catalog import Piece
from sgf_paper.unpack import UnpackError


def write_zip(file, members, mode=0):
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in members:
            info = zipfile.ZipInfo(name)
            info.external_attr = mode << 16
            archive.writestr(info, content)
    return file


def write_tar(file, members, how="w:gz", **attributes):
    """Members are names with contents; `attributes` go to each."""
    with tarfile.open(file, how) as archive:
        for name, content in members:
            info = tarfile.TarInfo(name)
            info.size = len(content)
            for key, value in attributes.items():
                setattr(info, key, value)
            archive.addfile(info, io.BytesIO(content))
    return file


@pytest.fixture
def folder(tmp_path):
    out = tmp_path / "work" / "out"
    out.mkdir(parents=True)
    return out


def everything(tmp_path):
    """All files and links below a folder, but for archives."""
    paths = [path for path in tmp_path.rglob("*") if path.is_symlink() or path.is_file()]
    return sorted(str(path.relative_to(tmp_path)) for path in paths if path.suffix not in (".zip", ".gz", ".tar"))


FILES = [("set/a/x.txt", b"x"), ("set/a/b/y.txt", b"yy"), ("other/z.txt", b"z")]


@pytest.mark.parametrize("kind", ["zip", "tar", "tar.gz"])
def test_the_named_folder_is_taken_wherever_it_is(tmp_path, folder, kind):
    file = tmp_path / f"data.{kind}"
    if kind == "zip":
        write_zip(file, FILES)
    else:
        write_tar(file, FILES, "w" if kind == "tar" else "w:gz")
    unpack.unpack(file, Piece(file.name, take="a", to="here"), folder)
    assert everything(tmp_path) == ["work/out/here/b/y.txt", "work/out/here/x.txt"]
    assert (folder / "here" / "b" / "y.txt").read_bytes() == b"yy"


def test_all_is_taken_without_a_single_folder_around_it(tmp_path, folder):
    unpack.unpack(write_zip(tmp_path / "one.zip", FILES[:2]), Piece("one.zip"), folder)
    assert everything(tmp_path) == ["work/out/a/b/y.txt", "work/out/a/x.txt"]


def test_all_is_taken_as_it_is_where_there_are_files_at_the_top(tmp_path, folder):
    members = [("./rgb/1.png", b"1"), ("./list.txt", b"2"), ("__MACOSX/rgb/._1.png", b"3")]
    unpack.unpack(write_tar(tmp_path / "top.tar.gz", members), Piece("top.tar.gz"), folder)
    assert everything(tmp_path) == ["work/out/list.txt", "work/out/rgb/1.png"]


def test_an_archive_in_an_archive(tmp_path, folder):
    inner = write_zip(tmp_path / "MH.zip", [("mav0/cam0/data.csv", b"1"), ("__MACOSX/mav0/._x", b"2")])
    members = [("hall/MH/MH.zip", inner.read_bytes()), ("hall/MH/MH.bag", b"bag"), ("__MACOSX/MH.zip", b"3")]
    outer = write_zip(tmp_path / "hall.zip", members)
    unpack.unpack(outer, Piece("hall.zip", inside="MH.zip", take="mav0", to="mav0"), folder)
    assert everything(tmp_path) == ["work/out/mav0/cam0/data.csv"]
    assert list(folder.parent.iterdir()) == [folder], "the inner archive is gone"


def test_pieces_share_a_folder(tmp_path, folder):
    write_zip(tmp_path / "a.zip", [("E3/q/s/im.png", b"1"), ("E3/t/s/im.png", b"2")])
    write_zip(tmp_path / "b.zip", [("E3/q/s/disp.pfm", b"3")])
    for name in ("a.zip", "b.zip"):
        unpack.unpack(tmp_path / name, Piece(name, take="q"), folder)
    assert everything(tmp_path) == ["work/out/s/disp.pfm", "work/out/s/im.png"]


OUTSIDE = ["../evil", "set/../../evil", "/tmp/evil_of_sgf", "set/.."]


@pytest.mark.parametrize("name", OUTSIDE)
@pytest.mark.parametrize("kind", ["zip", "tar.gz"])
def test_a_path_that_leads_out_refuses_the_whole_archive(tmp_path, folder, name, kind):
    write = write_zip if kind == "zip" else write_tar
    file = write(tmp_path / f"data.{kind}", [("set/fine.txt", b"1"), (name, b"evil")])
    with pytest.raises(UnpackError, match=f"data.{kind}: .*(absolute path|leads out)"):
        unpack.unpack(file, Piece(file.name), folder)
    assert everything(tmp_path) == [] and not os.path.exists("/tmp/evil_of_sgf")


KINDS = {
    "symbolic link": {"type": tarfile.SYMTYPE, "linkname": "/etc/passwd"},
    "symbolic link within": {"type": tarfile.SYMTYPE, "linkname": "fine.txt"},
    "hard link": {"type": tarfile.LNKTYPE, "linkname": "../../secret"},
    "character device": {"type": tarfile.CHRTYPE},
    "block device": {"type": tarfile.BLKTYPE},
    "pipe": {"type": tarfile.FIFOTYPE},
}


@pytest.mark.parametrize("kind", KINDS)
def test_links_and_devices_in_a_tar_refuse_the_whole_archive(tmp_path, folder, kind):
    file = tmp_path / "data.tar"
    write_tar(file, [("set/fine.txt", b"1")], "w")
    write_tar(file, [("set/other", b"")], "a", **KINDS[kind])
    with pytest.raises(UnpackError, match="data.tar: 'set/other' is a link or a device"):
        unpack.unpack(file, Piece(file.name), folder)
    assert everything(tmp_path) == []


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFCHR, stat.S_IFBLK, stat.S_IFIFO, stat.S_IFSOCK])
def test_links_and_devices_in_a_zip_refuse_the_whole_archive(tmp_path, folder, kind):
    file = write_zip(tmp_path / "data.zip", [("set/other", b"/etc/passwd")], kind | 0o777)
    with pytest.raises(UnpackError, match="data.zip: 'set/other' is a link or a device"):
        unpack.unpack(file, Piece(file.name), folder)
    assert everything(tmp_path) == []


def test_a_hostile_archive_within_an_archive_is_refused(tmp_path, folder):
    inner = write_zip(tmp_path / "MH.zip", [("mav0/x", b"1"), ("../../evil", b"evil")])
    outer = write_zip(tmp_path / "hall.zip", [("MH.zip", inner.read_bytes())])
    with pytest.raises(UnpackError, match="MH.zip: '../../evil' leads out"):
        unpack.unpack(outer, Piece("hall.zip", inside="MH.zip", take="mav0"), folder)
    assert everything(tmp_path) == []


def test_modes_are_not_taken_over(tmp_path, folder):
    file = write_tar(tmp_path / "data.tar.gz", [("set/tool", b"1")], mode=0o6777)
    unpack.unpack(file, Piece(file.name), folder)
    assert (folder / "tool").stat().st_mode & 0o7111 == 0


@pytest.mark.parametrize("names", [("a/x", "a/x"), ("a/x", "a/./x"), ("a/x", "a//x")])
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_two_members_of_one_place(tmp_path, folder, names):
    file = write_zip(tmp_path / "data.zip", [(name, b"1") for name in names])
    with pytest.raises(UnpackError, match="data.zip: two members want the same place"):
        unpack.unpack(file, Piece(file.name), folder)


def test_a_file_where_a_folder_has_to_be(tmp_path, folder):
    file = write_zip(tmp_path / "data.zip", [("a", b"1"), ("a/b", b"2")])
    with pytest.raises(UnpackError, match="data.zip: a file and a folder want the same place"):
        unpack.unpack(file, Piece(file.name), folder)


def test_a_name_that_no_file_can_have(tmp_path, folder):
    file = write_zip(tmp_path / "data.zip", [("a/" + 300 * "x", b"1")])
    with pytest.raises(UnpackError, match="data.zip: File name too long"):
        unpack.unpack(file, Piece(file.name), folder)


def test_a_path_of_very_many_folders(tmp_path, folder):
    with tarfile.open(tmp_path / "data.tar", "w", format=tarfile.GNU_FORMAT) as archive:
        archive.addfile(tarfile.TarInfo(20_000 * "a/" + "x"))
    with pytest.raises(UnpackError, match="data.tar: File name too long"):
        unpack.unpack(tmp_path / "data.tar", Piece("data.tar", take="a", to="b"), folder)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_zip_that_is_packed_in_another_way(tmp_path, folder, method):
    with zipfile.ZipFile(tmp_path / "data.zip", "w", method) as archive:
        archive.writestr("a/x", b"1")
    with pytest.raises(UnpackError, match="data.zip: 'a/x' is neither stored nor deflated"):
        unpack.unpack(tmp_path / "data.zip", Piece("data.zip"), folder)


@pytest.mark.parametrize("how", ["w:bz2", "w:xz"])
def test_a_tar_that_is_packed_in_another_way(tmp_path, folder, how):
    file = write_tar(tmp_path / "data.tar", FILES, how)
    assert not unpack.is_archive(file)
    with pytest.raises(UnpackError, match="data.tar: neither zip nor tar"):
        unpack.unpack(file, Piece(file.name), folder)


def test_members_of_a_zip_that_share_their_bytes(tmp_path, folder):
    file = write_zip(tmp_path / "data.zip", [("a/x", 3000 * b"x")])
    with zipfile.ZipFile(file, "a") as archive:
        for number in range(3):
            info = copy.copy(archive.getinfo("a/x"))
            info.filename = f"a/{number}"
            archive.filelist.append(info)
        archive._didModify = True
    with pytest.raises(UnpackError, match="data.zip: its members overlap"):
        unpack.unpack(file, Piece(file.name), folder)


def tar_header(name, size, kind=tarfile.REGTYPE):
    info = tarfile.TarInfo(name)
    info.size, info.type = size, kind
    return info.tobuf(tarfile.GNU_FORMAT)


@pytest.mark.parametrize("kind", [tarfile.GNUTYPE_LONGNAME, tarfile.XHDTYPE])
@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_a_header_that_asks_for_gigabytes(tmp_path, folder, kind, pack):
    file = tmp_path / "data.tar"
    file.write_bytes(pack(tar_header("a", 7 << 30, kind) + bytes(1024)))
    with pytest.raises(UnpackError, match="data.tar"):
        unpack.unpack(file, Piece(file.name), folder)


def test_a_size_below_zero(tmp_path, folder):
    file = tmp_path / "data.tar"
    file.write_bytes(tar_header("a", 0) + tar_header("b", -512) + bytes(1024))
    with pytest.raises(UnpackError, match="data.tar"):
        unpack.unpack(file, Piece(file.name), folder)


@pytest.mark.parametrize("take, times", [("none", 0), ("twice", 2)])
def test_a_folder_that_is_not_there_once(tmp_path, folder, take, times):
    file = write_zip(tmp_path / "data.zip", [("a/twice/x", b"1"), ("b/twice/x", b"1")])
    with pytest.raises(UnpackError, match=f"data.zip: folder '{take}' is there {times} times"):
        unpack.unpack(file, Piece(file.name, take=take), folder)


def test_an_inner_archive_that_is_not_there(tmp_path, folder):
    file = write_zip(tmp_path / "data.zip", FILES)
    with pytest.raises(UnpackError, match="data.zip: 'MH.zip' is there 0 times"):
        unpack.unpack(file, Piece(file.name, inside="MH.zip"), folder)


def damaged(file, at):
    data = bytearray(file.read_bytes())
    data[at] ^= 0xFF
    file.write_bytes(data)


def test_damaged_contents_are_noticed(tmp_path, folder):
    content = os.urandom(5000)
    damaged(write_zip(tmp_path / "data.zip", [("a/x", content)]), 2000)
    damaged(write_tar(tmp_path / "data.tar.gz", [("a/x", content)]), -6)  # the checksum at the end
    for name in ("data.zip", "data.tar.gz"):
        with pytest.raises(UnpackError, match=f"{name}: damaged"):
            unpack.unpack(tmp_path / name, Piece(name), folder)


def test_truncated_archives_are_noticed(tmp_path, folder):
    members = [("a/x", os.urandom(5000)), ("a/y", os.urandom(5000))]
    for file in (write_zip(tmp_path / "data.zip", members), write_tar(tmp_path / "data.tar.gz", members)):
        file.write_bytes(file.read_bytes()[:7000])
        with pytest.raises(UnpackError, match=file.name):
            unpack.unpack(file, Piece(file.name), folder)


def test_what_is_no_archive_is_said_with_its_beginning(tmp_path, folder):
    (tmp_path / "page.zip").write_text("<!DOCTYPE html><p>Log in</p>")
    with pytest.raises(UnpackError, match="page.zip: neither zip nor tar; begins with b'<!DOCTYPE html>"):
        unpack.unpack(tmp_path / "page.zip", Piece("page.zip"), folder)


def test_a_folder_lacks_what_it_has_to_hold_or_any_files(tmp_path):
    folder = tmp_path / "set"
    assert unpack.lacks(folder, []) == "files" and unpack.lacks(folder, ["a", "b"]) == "a"
    folder.mkdir()
    assert unpack.lacks(folder, []) == "files"
    (folder / "a").touch()
    assert unpack.lacks(folder, []) == "" and unpack.lacks(folder, ["a", "b"]) == "b"
    assert unpack.lacks(folder / "a", []) == "files", "a file is no folder"


def test_too_little_space_is_noticed_before_anything_is_written(tmp_path, folder, monkeypatch):
    usage = type("Usage", (), {"free": 2})
    monkeypatch.setattr(unpack.shutil, "disk_usage", lambda path: usage)
    file = write_zip(tmp_path / "data.zip", FILES)
    with pytest.raises(UnpackError, match="unpacking data.zip needs 0.0 GB; 0.0 GB are free"):
        unpack.unpack(file, Piece(file.name), folder)
    assert everything(tmp_path) == []
