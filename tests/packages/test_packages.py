"""The Debian packages that cpack makes: what is in them and what they depend on."""

import os
import re
import subprocess
from pathlib import Path

import pytest

BUILD = Path(os.environ["SGF_BUILD_DIR"])
LIBRARY = {"libsgf-dev", "sgf-tools"}
MRPT = {"mrpt-sgf-odometry", "libmrpt-sgf-odometry-dev"}
NAMES = LIBRARY | MRPT if list(BUILD.glob("lib/libmrpt-sgf-odometry.so*")) else LIBRARY
mrpt = pytest.mark.skipif(NAMES == LIBRARY, reason="the MRPT module is not part of the build")


def output_of(*command):
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True, timeout=600).stdout


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """Package files by name."""
    folder = tmp_path_factory.mktemp("packages")
    output_of("cpack", "--config", BUILD / "CPackConfig.cmake", "-B", folder)
    return {output_of("dpkg-deb", "-f", file, "Package").strip(): file for file in folder.glob("*.deb")}


def files_of(package):
    """Paths below /, without folders."""
    listing = (line.split(maxsplit=5) for line in output_of("dpkg-deb", "--contents", package).splitlines())
    return {path.split(" -> ")[0].removeprefix(".") for mode, *_, path in listing if not mode.startswith("d")}


def depends_of(package):
    """Names that a package depends on, with the versions asked for."""
    found = re.split(", ", output_of("dpkg-deb", "-f", package, "Depends").strip())
    return {name: version for name, _, version in (entry.partition(" ") for entry in found)}


def test_every_installed_file_is_in_one_package(packages, tmp_path):
    assert set(packages) == NAMES
    output_of("cmake", "--install", BUILD, "--prefix", tmp_path)
    installed = sorted(f"/usr/{path.relative_to(tmp_path)}" for path in tmp_path.rglob("*")
                       if path.is_symlink() or not path.is_dir())
    assert sorted(path for package in packages.values() for path in files_of(package)) == installed


def test_packages_say_what_they_are(packages):
    version = re.search(r"CMAKE_PROJECT_VERSION:STATIC=(.*)", (BUILD / "CMakeCache.txt").read_text())[1]
    summaries = set()
    for name, file in packages.items():
        assert re.fullmatch(rf"{name}_{version}_\w+\.deb", file.name)
        assert output_of("dpkg-deb", "-f", file, "Version").strip() == version
        assert re.search(r"^Maintainer: .+ <.+@.+>$", output_of("dpkg-deb", "-I", file).replace("\n ", "\n"), re.M)
        assert f"/usr/share/doc/{name}/copyright" in files_of(file)
        summaries.add(output_of("dpkg-deb", "-f", file, "Description").splitlines()[0])
    assert len(summaries) == len(packages)


def test_programs_depend_on_the_libraries_they_load_and_on_no_development_files(packages):
    for name in NAMES & {"sgf-tools", "mrpt-sgf-odometry"}:
        depends = depends_of(packages[name])
        assert {"libc6", "libstdc++6", "libtbb12"} <= set(depends)
        assert not [other for other in depends if other.endswith("-dev")]
    assert {"/usr/bin/sgf_stereo", "/usr/bin/sgf_render"} <= files_of(packages["sgf-tools"])


@mrpt
def test_the_plug_in_comes_with_the_programs_and_the_headers_without(packages):
    library, development = files_of(packages["mrpt-sgf-odometry"]), files_of(packages["libmrpt-sgf-odometry-dev"])
    assert {"/usr/lib/libmrpt-sgf-odometry-sensor.so", "/usr/share/man/man1/sgf-odometry-cli.1"} <= library
    assert {"/usr/lib/libmrpt-sgf-odometry.so", "/usr/include/mrpt/sgf/CSgfOdometry.h"} <= development
    version = output_of("dpkg-deb", "-f", packages["mrpt-sgf-odometry"], "Version").strip()
    assert depends_of(packages["libmrpt-sgf-odometry-dev"])["mrpt-sgf-odometry"] == f"(= {version})"
