"""Policies that play without torch: scripted ones, and shipped learned ones."""
