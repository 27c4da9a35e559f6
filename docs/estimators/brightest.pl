#!/usr/bin/env perl
# A leak finder in plain Perl: the three columns of each view that change most, paired from left to right.
# Usage: brightest.pl CLIP RESULT        (see any-estimator.md for what CLIP holds and RESULT must hold)
use strict;
use warnings;
use Compress::Zlib qw(uncompress);

my ($clip, $result) = @ARGV;
my @left  = brightest_columns("$clip/left",  3);
my @right = brightest_columns("$clip/right", 3);

my $rig = slurp("$clip/rig.yaml");
my @K = matrix($rig, 'K1');                 # [fx 0 cx; 0 fy cy; 0 0 1], px
my @T = matrix($rig, 'T');                  # X2 = R X1 + T, m: the right camera of a level rig has T = (-baseline, 0, 0)
my @P = matrix($rig, 'world_from_left');    # 4 x 4, m

my @leaks;
for my $i (0 .. $#left) {
    my $disparity = $left[$i] - $right[$i];
    next if $disparity <= 0;                # behind the cameras
    my $z = $K[0] * -$T[0] / $disparity;    # depth, m
    my $x = ($left[$i] - $K[2]) * $z / $K[0];
    push @leaks, sprintf '{"x_m": %.4f, "y_m": %.4f, "covariance_m2": null, "score": 1.0, '
        . '"left_column_px": %d, "right_column_px": %d, "column_sigma_px": null}',
        $P[0] * $x + $P[2] * $z + $P[3], $P[4] * $x + $P[6] * $z + $P[7], $left[$i], $right[$i];
}
open my $out, '>', $result or die "$result: $!";
print $out '{"method": "brightest.pl", "frame": "world", "diagnostics": {}, "leaks": [', join(', ', @leaks), "]}\n";
close $out or die "$result: $!";

# Columns of the largest mean (over rows) range (over frames), ascending; neighbours of a chosen one are left out.
sub brightest_columns {
    my ($folder, $count) = @_;
    my (@low, @high, $width);
    for my $path (sort glob "$folder/*.png") {
        ($width, my @grey) = read_grey_png($path);
        @low = @high = @grey unless @low;
        for my $i (0 .. $#grey) {
            $low[$i]  = $grey[$i] if $grey[$i] < $low[$i];
            $high[$i] = $grey[$i] if $grey[$i] > $high[$i];
        }
    }
    my @range = (0) x $width;
    $range[$_ % $width] += $high[$_] - $low[$_] for 0 .. $#low;
    my @chosen;
    for my $column (sort { $range[$b] <=> $range[$a] } 0 .. $width - 1) {
        next if grep { abs($_ - $column) <= 5 } @chosen;
        push @chosen, $column;
        last if @chosen == $count;
    }
    return sort { $a <=> $b } @chosen;
}

# An 8-bit grey PNG without interlacing: width, then the grey values row by row.
sub read_grey_png {
    my ($path) = @_;
    my $png = slurp($path);
    my ($width, $height, $depth, $colour) = unpack 'x16 N N C C', $png;
    die "$path: must be 8-bit grey\n" unless $depth == 8 && $colour == 0;
    my ($at, $data) = (8, '');
    while ($at < length $png) {
        my ($length, $kind) = unpack 'N a4', substr $png, $at, 8;
        $data .= substr $png, $at + 8, $length if $kind eq 'IDAT';
        $at += 12 + $length;
    }
    my @bytes = unpack 'C*', uncompress($data);
    my (@grey, @above);
    @above = (0) x $width;
    for my $row (0 .. $height - 1) {
        my $filter = shift @bytes;
        my @line = splice @bytes, 0, $width;
        for my $i (0 .. $width - 1) {
            my ($a, $b, $c) = ($i ? $line[$i - 1] : 0, $above[$i], $i ? $above[$i - 1] : 0);
            $line[$i] += (0, $a, $b, int(($a + $b) / 2), paeth($a, $b, $c))[$filter];
            $line[$i] &= 255;
        }
        push @grey, @line;
        @above = @line;
    }
    return ($width, @grey);
}

sub paeth {
    my ($a, $b, $c) = @_;
    my ($to_a, $to_b, $to_c) = (abs($b - $c), abs($a - $c), abs($a + $b - 2 * $c));
    return $to_a <= $to_b && $to_a <= $to_c ? $a : $to_b <= $to_c ? $b : $c;
}

# Numbers of a matrix in OpenCV's FileStorage YAML.
sub matrix {
    my ($yaml, $name) = @_;
    my ($data) = $yaml =~ /^$name:\s*!!opencv-matrix.*?data:\s*\[([^\]]*)\]/ms or die "rig.yaml: no $name\n";
    return map { $_ + 0 } split /[\s,]+/, $data =~ s/^\s+//r;
}

sub slurp {
    my ($path) = @_;
    open my $in, '<:raw', $path or die "$path: $!\n";
    local $/;
    return scalar <$in>;
}
