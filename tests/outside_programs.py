"""Programs that some tests need and the README does not promise; run, it prints Debian's packages of those missing."""

import shutil

#: Name in the mark ``needs(name)`` -> the commands it goes by, and Debian's packages.
PROGRAMS = {
    "chromium": (("chromium", "chromium-browser", "google-chrome"), "chromium"),
    "clang": (("clang",), "clang"),
    "gcc for ARM": (("arm-none-eabi-gcc",), "gcc-arm-none-eabi libnewlib-arm-none-eabi"),
    "gcc for RISC-V": (("riscv64-linux-gnu-gcc",), "gcc-riscv64-linux-gnu libc6-dev-riscv64-cross"),
    "node": (("node",), "nodejs"),
    "octave": (("octave-cli", "octave"), "octave"),
    "pdflatex": (("pdflatex",), "texlive-latex-recommended"),
    "qemu": (("qemu-arm",), "qemu-user"),
}


def missing() -> list[str]:
    """Names of the programs that are not there."""
    return [name for name, (commands, _) in PROGRAMS.items() if not any(map(shutil.which, commands))]


if __name__ == "__main__":
    print(*(PROGRAMS[name][1] for name in missing()))
