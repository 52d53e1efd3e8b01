"""The engine as Gymnasium and PettingZoo environments; the import registers Gymnasium's ids."""

import gymnasium

for _name in ("Team", "Solo"):
    if f"posse/{_name}-v0" not in gymnasium.registry:
        gymnasium.register(
            f"posse/{_name}-v0",
            entry_point=f"posse.adapters.gymnasium_env:{_name}Env",
            vector_entry_point=f"posse.adapters.vector_env:{_name}VectorEnv",
        )
