from benchmarl.algorithms import IppoConfig, MappoConfig, QmixConfig
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig

from posse_training.benchmarl import PosseTask

task = PosseTask.SMART.get_from_yaml()
model = MlpConfig.get_from_yaml()
config = ExperimentConfig.get_from_yaml()
config.max_n_frames = 640
for side in ("on", "off"):
    setattr(config, f"{side}_policy_collected_frames_per_batch", 640)
    setattr(config, f"{side}_policy_n_envs_per_worker", 8)
config.on_policy_minibatch_size = 320
config.on_policy_n_minibatch_iters = 1
config.off_policy_train_batch_size = 64
config.off_policy_n_optimizer_steps = 2
config.off_policy_memory_size = 1000
config.evaluation, config.loggers = False, []
# QMIX is given discrete actions.
for kind in (MappoConfig, IppoConfig, QmixConfig):
    algorithm = kind.get_from_yaml()
    Experiment(task, algorithm, model, seed=0, config=config).run()
