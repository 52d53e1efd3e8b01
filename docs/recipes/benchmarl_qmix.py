from benchmarl.algorithms import QmixConfig
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig

from posse_training.benchmarl import PosseTask

task, model = PosseTask.SMART.get_from_yaml(), MlpConfig.get_from_yaml()
config = ExperimentConfig.get_from_yaml()  # QMIX asks for discrete actions, and is given them
config.max_n_frames = config.off_policy_collected_frames_per_batch = 640
config.off_policy_n_envs_per_worker, config.off_policy_train_batch_size = 8, 64
config.off_policy_n_optimizer_steps, config.off_policy_memory_size = 2, 1000
config.evaluation, config.loggers = False, []
Experiment(task, QmixConfig.get_from_yaml(), model, seed=0, config=config).run()
