"""``posse completion``: what a shell needs to complete commands and their options."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from posse_training.cli import COMMANDS
from posse_training.errors import SettingsError

_BASH: Final = """\
_posse() {
    local word=${COMP_WORDS[COMP_CWORD]}
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "@COMMANDS@ --help --version" -- "$word"))
    elif [ "${word#-}" != "$word" ]; then
        local options
        options=$("${COMP_WORDS[0]}" "${COMP_WORDS[1]}" --help 2>/dev/null \\
            | grep -oE -- '--[a-z][a-z0-9.-]*')
        COMPREPLY=($(compgen -W "$options" -- "$word"))
    fi
}
complete -o default -F _posse posse
"""
_ZSH: Final = "autoload -U +X bashcompinit && bashcompinit\n"
_SHELLS: Final = {"bash": _BASH, "zsh": _ZSH + _BASH}


def main(arguments: Sequence[str]) -> None:
    """Print the completion of a shell: ``eval "$(posse completion bash)"``.

    Raises:
        SettingsError: No shell is named, or one without completion.
    """
    if list(arguments) in (["-h"], ["--help"]):
        print('usage: posse completion {bash,zsh}\n\nIn ~/.bashrc: eval "$(posse completion bash)"')
        return
    if len(arguments) != 1 or arguments[0] not in _SHELLS:
        raise SettingsError(f"{' '.join(arguments)!r:.80} is no shell: name one of {', '.join(_SHELLS)}")
    print(_SHELLS[arguments[0]].replace("@COMMANDS@", " ".join(COMMANDS)), end="")
