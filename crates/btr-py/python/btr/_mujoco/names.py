"""Names of links and joints: MuJoCo's own where there are any and btr can use them."""

from __future__ import annotations

from typing import Any

FORBIDDEN = str.maketrans(dict.fromkeys("@#*,`\"'{}\\\n\t", "_"))
"""Characters with a meaning of their own where a model file or a log names a joint."""


def name_of(mj: Any, kind: str, index: int) -> str:
    """The name of an element (`joint`, `body`, ...) in MuJoCo, or its kind and number."""
    return getattr(mj, kind)(index).name or f"{kind} {index}"


class Names:
    """Unique names of the joints and bodies of a model."""

    def __init__(self, mj: Any) -> None:
        self.renamed: list[str] = []
        """What was renamed, in words."""
        self._joints = self._of(mj, "joint", mj.njnt)
        self._bodies = self._of(mj, "body", mj.nbody)
        self._taken = set(self._bodies)

    def joint(self, index: int) -> str:
        return self._joints[index]

    def body(self, index: int) -> str:
        return self._bodies[index]

    def between(self, body: int, joint: int) -> str:
        """A name for the massless link after a joint that is not its body's last."""
        name = f"{self.body(body)}_{self.joint(joint)}"
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name

    def _of(self, mj: Any, kind: str, count: int) -> list[str]:
        names: list[str] = []
        for index in range(count):
            theirs = getattr(mj, kind)(index).name
            name = (theirs or f"{kind}{index}").translate(FORBIDDEN)
            while name in names:
                name += "_"
            if theirs and name != theirs:
                self.renamed.append(f"the name of the {kind} `{theirs}`: it is `{name}` here")
            names.append(name)
        return names
