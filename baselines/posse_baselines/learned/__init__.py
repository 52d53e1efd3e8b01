"""Learned policies, which play without torch."""
