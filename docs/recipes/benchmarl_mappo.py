from benchmarl.algorithms import IppoConfig, MappoConfig
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig

from posse_training.benchmarl import PosseTask

task, model = PosseTask.SMART.get_from_yaml(), MlpConfig.get_from_yaml()
config = ExperimentConfig.get_from_yaml()
config.max_n_frames = config.on_policy_collected_frames_per_batch = 640
config.on_policy_n_envs_per_worker, config.on_policy_minibatch_size = 8, 320
config.on_policy_n_minibatch_iters, config.evaluation, config.loggers = 1, False, []
for algorithm in (MappoConfig, IppoConfig):
    Experiment(task, algorithm.get_from_yaml(), model, seed=0, config=config).run()
