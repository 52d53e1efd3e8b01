from benchmarl.algorithms import QmixConfig
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig

from posse_training.benchmarl import PosseTask

task = PosseTask.SMART.get_from_yaml()
model = MlpConfig.get_from_yaml()
qmix = QmixConfig.get_from_yaml()  # is given discrete actions
config = ExperimentConfig.get_from_yaml()
config.max_n_frames = 640
config.off_policy_collected_frames_per_batch = 640
config.off_policy_n_envs_per_worker = 8
config.off_policy_train_batch_size = 64
config.off_policy_n_optimizer_steps = 2
config.off_policy_memory_size = 1000
config.evaluation, config.loggers = False, []
Experiment(task, qmix, model, seed=0, config=config).run()
