"""The cartridge: frames of one stretch in, where the groove walls run out, with error bars."""
