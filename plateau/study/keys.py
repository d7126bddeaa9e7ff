"""The Redis keys of observer studies.

========================= ======= ==================================================== =========
key                       type    what                                                 lifetime
========================= ======= ==================================================== =========
plateau:studies           zset    observer study, scored by its creation (ms)          the study's
plateau:studies:asked     hash    digest of a request → the study that it made         the study's
plateau:study:ID          hash    the study; see `study.ledger`                        till DELETE
plateau:study:ID:making   string  set while its pictures are put                       30 min
plateau:study:ID:observers hash   pseudonym → JSON of number and screen                the study's
plateau:study:ID:answers  hash    pseudonym:number of a pair → JSON of the answer      the study's
========================= ======= ==================================================== =========
"""

from importlib.resources import files
from typing import Final

from plateau.farm.redis.keys import PREFIX

STUDIES: Final = PREFIX + "studies"
STUDIES_ASKED: Final = PREFIX + "studies:asked"


def study(study_id: str, part: str = "") -> str:
    """The key of an observer study, or of one of its parts (``observers``, …)."""
    return f"{PREFIX}study:{study_id}:{part}" if part else f"{PREFIX}study:{study_id}"


_ID: Final = "?" * 12
#: What a monitor reads to sweep, and what else an API needs.
SWEPT: Final = (study(_ID), study(_ID, "making"))
SERVED: Final = (STUDIES, STUDIES_ASKED, study(_ID, "*"))


def script() -> str:
    """The commands of `plateau.study.redis_commands` in Lua, with the names of keys."""
    names = f"""
local STUDIES, STUDIES_ASKED = '{STUDIES}', '{STUDIES_ASKED}'
local function study_key(id, part)
  return PREFIX .. 'study:' .. id .. (part and ':' .. part or '')
end
"""
    return names + (files("plateau.study") / "studies.lua").read_text(encoding="utf-8")
