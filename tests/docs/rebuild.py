"""Programs of a build folder made again from changed sources, in another folder.

It is what Ninja would do after the change, by the commands of the build folder, but for optimisation: what includes
a changed header is compiled, and all else is taken as it was built.
"""

import json
import shlex
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

# Less optimised, and for one instruction set: sooner compiled.
FLAGS = ["-O1", "-DHWY_COMPILE_ONLY_STATIC"]


@dataclass(frozen=True)
class Rebuild:
    project: Path
    build: Path
    folder: Path  # of the changed sources, in src/, and of what is made

    def __call__(self, programs, header, left_out=()):
        """Makes the programs from the changed sources.

        @param header that changed, below src/. @param left_out libraries whose objects that include it are not linked
        into these programs."""
        (self.folder / "include").mkdir(exist_ok=True)
        (self.folder / "include" / "sgf").symlink_to(self.folder / "src")
        inputs = self._ninja("inputs", *(f"bin/{name}" for name in programs)).split()
        for path in inputs:
            if not path.startswith("/") and path.endswith((".a", ".o")):
                self._copy(path)
        changed = [path for path in self._users(header) if path in inputs and _target(path) not in left_out]
        commands = {entry["output"]: entry["command"] for entry in json.loads(self._ninja("compdb"))}
        for path in changed:
            self._compile(path, commands[path])
        self._archive(changed)
        for name in programs:
            self._run(self._ninja("commands", f"bin/{name}").splitlines()[-1])

    def _ninja(self, tool, *arguments):
        command = ["ninja", "-C", self.build, "-t", tool, *arguments]
        lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return lines.removeprefix(f"ninja: Entering directory `{self.build}'\n")

    def _users(self, header):
        """Objects that include the header."""
        users, user = [], ""
        for line in self._ninja("deps").splitlines():
            if line and not line.startswith(" "):
                user = line.split(":")[0]
            elif line.endswith(f"sgf/{header}"):
                users.append(user)
        return users

    def _copy(self, path):
        (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(self.build / path, self.folder / path)

    def _compile(self, path, command):
        command = command.replace(f"{self.project}/src/", f"{self.folder}/src/")
        command = command.replace(f"-I{self.build}/include", f"-I{self.folder}/include")
        source = shlex.split(command)[-1]
        if source.startswith(f"{self.build}/"):  # several files as one, which CMake has written
            copy = self.folder / Path(source).relative_to(self.build)
            copy.write_text(Path(source).read_text().replace(f"{self.project}/src/", f"{self.folder}/src/"))
            command = command.replace(source, str(copy))
        assert str(self.folder) in command, command
        self._run(f"{command} {shlex.join(FLAGS)}")

    def _archive(self, objects):
        """Puts objects into their libraries."""
        for path in objects:
            library = f"lib/lib{_target(path).replace('_library', '')}.a"
            if (self.folder / library).exists():
                self._run(f"ar r {library} {path}")

    def _run(self, command):
        (self.folder / "bin").mkdir(exist_ok=True)
        done = subprocess.run(command, shell=True, cwd=self.folder, capture_output=True, text=True)
        assert done.returncode == 0, f"{command}\n{done.stderr}"


def _target(path):
    """The target of an object."""
    return next(part for part in Path(path).parts if part.endswith(".dir")).removesuffix(".dir")
