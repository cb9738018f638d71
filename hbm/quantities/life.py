"""Cycles until the preload has fallen to a share of its first value: where the contact is lost."""

from tribodyn.hbm.quantity import ErrorKind, WearQuantity, WornContact
from tribodyn.hbm.wear.history import cycles_to_preload, cycles_to_share


def value(worn: WornContact) -> float | None:
    """Cycles, None where it has not fallen so far; of a joint, and where one lost joint ends it, by its own preload."""
    history = worn.history
    if worn.joint:
        return cycles_to_share(history.cycles, history.normal_force[:, worn.pairs].sum(axis=1), worn.life_share)
    if not worn.any_joint:
        return cycles_to_preload(history, worn.life_share)
    lives = (value(worn.of_joint(name)) for name in worn.joints if len(worn.area[worn.joints[name]]))
    return min((life for life in lives if life is not None), default=None)


def remark(worn: WornContact) -> str:
    """Where it ends."""
    if worn.any_joint and not worn.joint:
        life = value(worn)
        joint = next((name for name in worn.joints if value(worn.of_joint(name)) == life), "")
        return f"until contact {joint} is lost"
    at_rest = worn.history.preload_at_rest is not None and not worn.joint
    return f"until {100 * worn.life_share:g} % of the preload{' at rest' if at_rest else ''} is left"


QUANTITY = WearQuantity(
    "life", "cycles", value, by_joint=True, error=ErrorKind.DURATION, rank=21, remark=remark,
)  # fmt: skip
