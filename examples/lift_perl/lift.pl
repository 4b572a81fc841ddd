# The lift under test. It speaks the component protocol (docs/programs.md) with what comes with Perl.
use strict;
use warnings;
use JSON::PP;

$| = 1;    # each line leaves at once
my $json = JSON::PP->new->canonical;

# A component is a function for each channel, and one for each transition that no message starts. It returns the
# transition that it takes and the messages that it sends.

my %state;
my %components = (
    Panel => {
        call    => sub { my $message = shift; return ('p1', request => $message) },
        arrived => sub { my $message = shift; return ('p2', lamp    => $message) },
    },
    Cabin => {
        request => sub {
            my $message = shift;
            return ('c4', arrived => {floor => $state{floor}}) if $message->{floor} == $state{floor};
            $state{target} = $message->{floor};
            return ('c1', close => {hold => 0.5});
        },
        door => sub {
            my $message = shift;
            return ('c3', close => {hold => $state{slow_close}}) if !$message->{shut};
            $state{floor} = $state{target};
            return ('c2', arrived => {floor => $state{floor}});
        },
    },
    Door => {
        close => sub {
            return ('d1', door => {shut => JSON::PP::false}) if $state{blocked};
            return ('d2', door => {shut => JSON::PP::true});
        },
        d3 => sub { return ('d3') },
    },
);

my ($component, $begin);    # $begin: what the next permit lets happen

while (my $line = <STDIN>) {
    my ($word, $content) = %{$json->decode($line)};
    if ($word eq 'hello') {
        $component = $components{$content->{component}};
        answer({hello => {component => $content->{component}}});
    }
    elsif ($word eq 'reset') {
        %state = (floor => 0, target => 0, slow_close => 2.0, blocked => 0);
        undef $begin;
        answer({reset => JSON::PP::true});
    }
    elsif ($word eq 'inputs') { %state = (%state, %$content) }
    elsif ($word eq 'deliver') {
        my $function = $component->{$content->{channel}};
        $begin = sub { $function->($content->{message}) };
    }
    elsif ($word eq 'ask') { $begin = $component->{$content->{transition} // ''} }
    elsif ($word eq 'permit') {
        my ($transition, @sent) = $begin ? $begin->() : undef;
        undef $begin;
        while (my ($channel, $message) = splice @sent, 0, 2) {
            answer({sent => {channel => $channel, message => $message}});
        }
        answer({took => $transition});
    }
}

sub answer { print $json->encode(shift), "\n" }
